"""Where the C and C++ library is that the wheel carries: ``python -m impinge.cmake`` prints a prefix for CMake.

.. code-block:: sh

    cmake -S . -B build -Dimpinge_ROOT="$(python -m impinge.cmake)"

``find_package(impinge CONFIG)`` then finds ``impinge::impinge``, the shared library with `impinge.h` and `impinge/impinge.hpp`. It is the
CPU backend. A program that is linked with it finds it where it lies, until CMake installs the program elsewhere.
"""

from __future__ import annotations

import sys
from pathlib import Path

__all__ = ["prefix"]


def prefix() -> Path:
    """The folder with ``include`` and ``lib``.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    FileNotFoundError
        The module was built without the C library, as from a source distribution.
    """
    found = Path(__file__).resolve().parent / "_c"
    if not (found / "lib/cmake/impinge/impinge-config.cmake").is_file():
        raise FileNotFoundError(
            f"{found}: this build of the module has no C library: wheels that are released have it, and scripts/install-c of a checkout installs it"
        )
    return found


def main() -> int:
    """Prints the prefix; returns the exit code."""
    try:
        print(prefix())
    except FileNotFoundError as error:
        print(f"impinge.cmake: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
