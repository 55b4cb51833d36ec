"""The program ``impinge-check``: `impinge check` of the program ``impinge``, where only Python is at hand, as in a hook of pre-commit or
a workflow. It has the same options, words and exit codes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from typing import Any

from ._check import check
from ._impinge import __version__

_Row = dict[str, Any]

#: What `--fail-on` can name, in the order of the summary, and its words in "3 with …".
_PROBLEMS = {
    "self-intersections": "self-intersections",
    "degenerate": "degenerate primitives",
    "duplicates": "duplicate primitives",
    "non-manifold": "non-manifold edges or vertices",
    "orientation": "inconsistent orientation",
    "boundary": "an open border",
    "nan": "coordinates that are not finite",
    "error": "an error",
}
#: The columns of a table, and the keys that each adds up.
_COLUMNS = {
    "mesh": (),
    "primitives": ("triangles", "tetrahedra"),
    "self-int.": ("self_intersections",),
    "degenerate": ("degenerate",),
    "duplicate": ("duplicate_faces", "duplicate_tetrahedra"),
    "non-man.": ("non_manifold_edges", "non_manifold_faces", "non_manifold_vertices"),
    "orient.": ("inconsistent_edges", "inconsistent_faces"),
    "border": ("boundary_edges", "boundary_faces"),
    "pieces": ("components",),
}
#: What each problem counts; meshes of tetrahedra always have a border.
_KEYS = {
    "self-intersections": _COLUMNS["self-int."],
    "degenerate": _COLUMNS["degenerate"],
    "duplicates": _COLUMNS["duplicate"],
    "non-manifold": _COLUMNS["non-man."],
    "orientation": _COLUMNS["orient."],
    "boundary": ("boundary_edges",),
}
#: The most meshes that a table lists.
_LISTED = 50


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the program; returns its exit code: 0, 1 where a mesh could not be checked, 2 for a wrong command line, 3 for what
    ``--fail-on`` names.
    """
    args = _parser().parse_args(arguments)
    paths = args.meshes + ([] if args.list is None else _listed(args.list))
    if not paths and args.list is None:
        _parser().error("the following arguments are required: MESH")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # Names of files need not be text in any encoding.
            stream.reconfigure(errors="backslashreplace")
    try:
        rows = check(paths, weld=not args.no_weld, jobs=args.jobs, timeout=args.timeout)
        named = [*_PROBLEMS] if "any" in args.fail_on else [what for what in _PROBLEMS if what in args.fail_on]
        if args.json:
            print("".join(json.dumps(row) + "\n" for row in rows), end="")
        else:
            print(_text(rows), end="")
        if args.format == "github":
            print("".join(_annotation(row, named) + "\n" for row in rows if _is_any(row)), end="")
        if args.summary is not None:
            # A workflow's summary is a file to which each step appends.
            with open(args.summary, "a", encoding="utf-8") as file:
                file.write(_markdown(rows, named))
    except (OSError, ValueError, RuntimeError) as error:
        print(f"impinge-check: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    failure, code = _failure(rows, named)
    if failure:
        print(f"impinge-check: {failure}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="impinge-check", description="Counts what is wrong with meshes. Every count is exact.")
    parser.add_argument("meshes", metavar="MESH", nargs="*", help="mesh files")
    parser.add_argument("--list", metavar="FILE", help="a file with one path per line (- for standard input)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON per mesh and nothing else")
    parser.add_argument(
        "--fail-on",
        metavar="WHAT",
        type=_named,
        default=[],
        help=f"exit with code 3 if any mesh has one of these problems (comma-separated): {', '.join(_PROBLEMS)}, any; "
        "a mesh that could not be checked always fails",
    )
    parser.add_argument("--no-weld", action="store_true", help="do not weld vertices at the same position")
    parser.add_argument("--timeout", metavar="S", type=float, help="seconds that one mesh may take")
    parser.add_argument("--jobs", metavar="N", type=int, help="child processes at a time; by default one per core")
    parser.add_argument("--format", choices=["text", "github"], default="text", help="github: annotations for a workflow, besides")
    parser.add_argument("--summary", metavar="FILE", help="append a table in Markdown to this file")
    parser.add_argument("--version", action="version", version=f"impinge-check {__version__}")
    return parser


def _named(text: str) -> list[str]:
    named = text.split(",")
    for what in named:
        if what not in _PROBLEMS and what != "any":
            raise argparse.ArgumentTypeError(f"{what!r} is none of {', '.join(_PROBLEMS)}, any")
    return named


def _listed(name: str) -> list[str]:
    try:
        if name == "-":
            text = sys.stdin.buffer.read()
        else:
            with open(name, "rb") as file:
                text = file.read()
    except OSError as error:
        print(f"impinge-check: {error}", file=sys.stderr)
        raise SystemExit(1) from error
    lines = [os.fsdecode(line.rstrip(b"\r")) for line in text.split(b"\n")]
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def _sum(row: _Row, keys: Sequence[str]) -> int:
    return sum(row.get(key) or 0 for key in keys)


def _has(row: _Row, what: str) -> bool:
    if what == "error":
        return row["error"] is not None
    if what == "nan":
        return bool(row["error_kind"] == "not_finite")
    return row["error"] is None and _sum(row, _KEYS[what]) > 0


def _is_any(row: _Row) -> bool:
    return any(_has(row, what) for what in _PROBLEMS)


def _printable(name: str) -> str:
    names = {"\n": r"\n", "\r": r"\r", "\t": r"\t"}
    return "".join(names.get(c, f"\\u{{{ord(c):x}}}") if ord(c) < 32 or 127 <= ord(c) < 160 else c for c in name)


def _meshes(n: int) -> str:
    return f"{n:,} mesh{'' if n == 1 else 'es'}"


def _cells(row: _Row) -> list[str]:
    return [_printable(row["path"]), *(f"{_sum(row, keys):,}" for keys in _COLUMNS.values() if keys)]


def _error(row: _Row) -> str:
    name, message = _printable(row["path"]), str(row["error"])
    # Most messages about files already name the file.
    return message if message.startswith(name) else f"{name}: {message}"


def _text(rows: list[_Row]) -> str:
    """The table of the program: one line per mesh (if there are many, of meshes with a problem), then a summary."""
    few = len(rows) <= _LISTED
    listed = [row for row in rows if few or _is_any(row)]
    lines = [_cells(row) for row in listed[:_LISTED] if row["error"] is None]
    text = ""
    if lines:
        lines = [list(_COLUMNS), *lines]
        widths = [max(len(line[ix]) for line in lines) for ix in range(len(_COLUMNS))]
        for line in lines:
            cells = [cell.rjust(width) if ix else cell.ljust(width) for ix, (cell, width) in enumerate(zip(line, widths))]
            text += "  ".join(cells).rstrip() + "\n"
        text += "\n"
    text += "".join(_error(row) + "\n" for row in listed[:_LISTED] if row["error"] is not None)
    if len(listed) > _LISTED:
        text += f"… and {_meshes(len(listed) - _LISTED)} more: see --json\n"
    return text + _summary(rows) + "\n"


def _summary(rows: list[_Row]) -> str:
    n_clean = sum(not _is_any(row) for row in rows)
    if n_clean == len(rows) and n_clean > 0:
        return f"{_meshes(n_clean)}: {'clean' if n_clean == 1 else 'all clean'}"
    parts = [f"{n_clean:,} without any finding", *_counts(rows, _PROBLEMS)]
    return f"{_meshes(len(rows))}: {', '.join(parts)}"


def _counts(rows: list[_Row], problems: Sequence[str] | dict[str, str]) -> list[str]:
    counts = [(sum(_has(row, what) for row in rows), what) for what in problems]
    return [f"{n:,} with {_PROBLEMS[what]}" for n, what in counts if n]


def _failure(rows: list[_Row], named: Sequence[str]) -> tuple[str, int]:
    """What the last line on standard error says, and the exit code."""
    unchecked = [row for row in rows if row["error"] is not None]
    failed = [row for row in rows if any(_has(row, what) for what in named)]
    if not failed:
        return (f"{len(unchecked):,} of {len(rows):,} meshes could not be checked", 1) if unchecked else ("", 0)
    found = _counts(rows, named)
    if unchecked and "error" not in named:
        found.append(f"{len(unchecked):,} could not be checked")
    n_failed = sum(row in failed or row["error"] is not None for row in rows)
    return f"{n_failed:,} of {len(rows):,} meshes failed: {', '.join(found)}", 3


def _said(row: _Row) -> str:
    """What is wrong with a mesh, in a line."""
    if row["error"] is not None:
        return _error(row)
    found = [what for what in _PROBLEMS if _has(row, what)]
    return ", ".join(f"{_sum(row, _KEYS[what]):,} {_unit(what, row)}" for what in found)


def _unit(what: str, row: _Row) -> str:
    facets = "faces" if row["tetrahedra"] else "edges"
    return {
        "non-manifold": _PROBLEMS[what],
        "boundary": f"{facets} of an open border",
        "orientation": f"{facets} of inconsistent orientation",
    }.get(what, _PROBLEMS[what])


def _annotation(row: _Row, named: Sequence[str]) -> str:
    """A line that a workflow of GitHub shows beside the file."""
    level = "error" if row["error"] is not None or any(_has(row, what) for what in named) else "warning"

    def escaped(text: str, more: str = "") -> str:
        for c in "%\r\n" + more:
            text = text.replace(c, f"%{ord(c):02X}")
        return text

    return f"::{level} file={escaped(row['path'], ':,')},title=impinge check::{escaped(_said(row))}"


def _markdown(rows: list[_Row], named: Sequence[str]) -> str:
    """A table for a workflow's summary: meshes with a problem, those that fail first."""
    failure, code = _failure(rows, named)
    text = f"### impinge check\n\n{failure or _summary(rows)}\n\n"
    bad = [row for row in rows if _is_any(row)]
    bad.sort(key=lambda row: not (row["error"] is not None or any(_has(row, what) for what in named)))
    counted = [row for row in bad if row["error"] is None][:_LISTED]

    def cell(text: str) -> str:
        return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("`", "\\`")

    if counted:
        text += f"| {' | '.join(_COLUMNS)} |\n|---|{'---:|' * (len(_COLUMNS) - 1)}\n"
        text += "".join(f"| {' | '.join(map(cell, _cells(row)))} |\n" for row in counted) + "\n"
    text += "".join(f"- {cell(_error(row))}\n" for row in bad[:_LISTED] if row["error"] is not None)
    if len(bad) > _LISTED:
        text += f"\nOnly {_LISTED} of {_meshes(len(bad))} with a problem are listed.\n"
    return text + "\n"


if __name__ == "__main__":
    sys.exit(main())
