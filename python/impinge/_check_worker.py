"""A child process of `impinge.check`: paths in, rows out, one line of JSON each. `impinge._check` starts it."""

import signal
import sys

from . import _impinge


def main() -> None:
    """Answers until standard input ends."""
    # Ctrl-C goes to all processes of a terminal: the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    weld, threads, memory = (int(argument) for argument in sys.argv[1:4])
    min_thickness = float(sys.argv[4])
    _impinge._serve_check(bool(weld), threads, memory or None, min_thickness or None)
