"""The program ``impinge-check``: `impinge check` of the program ``impinge``, where only Python is at hand, as in a hook of pre-commit or
a workflow. It has the same options, words and exit codes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence

from . import _impinge
from ._check import check

#: What `--fail-on` can name, besides `any`.
_FINDINGS = _impinge._findings()


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the program; returns its exit code: 0, 1 where a mesh could not be checked, 2 for a wrong command line, 3 for what
    ``--fail-on`` names.
    """
    args = _parser().parse_args(arguments)
    paths = args.meshes + ([] if args.list is None else _listed(args.list))
    if not paths and args.list is None:
        _parser().error("the following arguments are required: MESH")
    if not paths:
        _parser().error(f"--list {args.list}: it names no mesh")
    if "thin" in args.fail_on and args.min_thickness is None and len(args.fail_on) < len(_FINDINGS):
        _parser().error("--fail-on thin: --min-thickness T says how thin")
    if args.rows is not None and _suffix(args.rows) not in ("csv", "jsonl", "parquet"):
        _parser().error(f"--rows {args.rows}: rows of meshes are written as .csv, .jsonl, .parquet")
    options = {"weld": not args.no_weld, "min_thickness": args.min_thickness, "jobs": args.jobs, "timeout": args.timeout}
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # Names of files need not be text in any encoding.
            stream.reconfigure(errors="backslashreplace")
    try:
        rows = [json.dumps(row) for row in check(paths, **options)]
        text, failed = _impinge._report(rows, args.fail_on, args.format)
        print("".join(row + "\n" for row in rows) if args.json else text, end="")
        if args.rows is not None:
            _write_rows(args.rows, rows)
        if args.summary is not None:
            # A workflow's summary is a file to which each step appends.
            with open(args.summary, "a", encoding="utf-8") as file:
                file.write(_impinge._report(rows, args.fail_on, "markdown")[0])
    except (ImportError, OSError, ValueError, RuntimeError) as error:
        print(f"impinge-check: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    if failed is None:
        return 0
    message, is_finding = failed
    print(f"impinge-check: {message}", file=sys.stderr)
    return 3 if is_finding else 1


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
        help=f"exit with code 3 if any mesh has one of these problems (comma-separated): {', '.join(_FINDINGS)}, any; "
        "a mesh that could not be checked always fails",
    )
    parser.add_argument("--no-weld", action="store_true", help="do not weld vertices at the same position")
    parser.add_argument("--min-thickness", metavar="T", type=float, help="find walls that are at most this thick, in the unit of the file")
    parser.add_argument("--timeout", metavar="S", type=float, help="seconds that one mesh may take")
    parser.add_argument("--jobs", metavar="N", type=int, help="child processes at a time; by default one per core")
    parser.add_argument("--format", choices=["text", "github"], default="text", help="github: annotations for a workflow")
    parser.add_argument("--rows", metavar="FILE", help="write a table with a row per mesh (.csv, .jsonl, or with pyarrow .parquet)")
    parser.add_argument("--summary", metavar="FILE", help="append a table in Markdown to this file")
    parser.add_argument("--version", action="version", version=f"impinge-check {_impinge.__version__}")
    return parser


def _write_rows(path: str, rows: list[str]) -> None:
    """Writes the table of `impinge check --rows`. The file is whole or not there."""
    part = f"{path}.part"
    try:
        kind = _suffix(path)
        if kind == "parquet":
            _write_parquet(part, rows)
        else:
            with open(part, "w", encoding="utf-8", newline="") as file:
                file.write(_impinge._report(rows, [], kind)[0])
        os.replace(part, path)
    finally:
        if os.path.exists(part):
            os.remove(part)


def _write_parquet(path: str, rows: list[str]) -> None:
    try:
        import pyarrow  # type: ignore[import-not-found, import-untyped, unused-ignore]
        import pyarrow.parquet  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError as error:
        raise ImportError("--rows: .parquet needs pyarrow: pip install pyarrow") from error
    types = {"text": pyarrow.string(), "flag": pyarrow.bool_(), "count": pyarrow.int64(), "number": pyarrow.float64()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in _impinge._check_columns()])
    # Keys of a row that are no columns, its places, are left out.
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist([json.loads(row) for row in rows], schema), path)


def _suffix(path: str) -> str:
    return os.path.splitext(path)[1].lower().removeprefix(".")


def _named(text: str) -> list[str]:
    named = text.split(",")
    for what in named:
        if what not in _FINDINGS and what != "any":
            raise argparse.ArgumentTypeError(f"{what!r} is none of {', '.join(_FINDINGS)}, any")
    return _FINDINGS if "any" in named else named


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


if __name__ == "__main__":
    sys.exit(main())
