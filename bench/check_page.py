"""The table of the book's page about checkers, from the newest record of `check.py`.

    python bench/check_page.py            # writes it
    python bench/check_page.py --check    # fails if the page says something else
"""

import json
import re
import sys

from records import ROOT

PAGE = ROOT / "book" / "src" / "reference" / "checkers.md"
#: Between these lines.
TABLE = re.compile(r"(?<=<!-- made by bench/check_page.py -->\n\n).*?(?=\n\n<!-- end -->)", re.DOTALL)
HEAD = [
    "tool", "version", "meshes", "of them answered wrong", "missed", "false", "no mesh, and yet numbers", "ms per mesh", "impinge, ms"
]


def newest():
    """The record, and where it is."""
    path = max(ROOT.glob("bench/record/*/check.json"), key=lambda path: json.loads(path.read_text())["date"])
    return json.loads(path.read_text()), path


def row(record, label, of):
    """What one tool did. `of` is its row of times."""
    per_mesh = [f"{1000 * of[key] / of['files']:.2f}" for key in ("seconds", "ours")]
    name, found = label.strip("*").removesuffix(" check"), record["self_intersections"].get(label)
    cells = [label, record["versions"][name], f"{of['files']:,}"]
    if name == "impinge":
        cells[2] = f"{of['files'] - sum(record['broken'][name].values()):,}"
        cells += [f"**{len(record['wrong'])}**", "0", "0"]
        per_mesh[1] = ""
    elif not found:
        cells += ["does not look for them", "", ""]
    else:
        n = {end: sum(one["n"] for key, one in found["differences"].items() if key.startswith(end)) for end in ("peer misses", "peer reports")}
        says = any(key.startswith("peer says") for key in found["differences"])
        cells += [f"{found['wrong']:,}", *(["", ""] if says else [f"{n['peer misses']:,}", f"{n['peer reports']:,}"])]
    broken = record["broken"][name]
    return [*cells, f"{broken.get('counts', 0)} of {sum(broken.values())}", *per_mesh]


def table(record, path):
    """The sentence above the table, and the table."""
    said = (
        f"{record['files']:,} files: {record['files'] - sum(record['broken']['impinge'].values()):,} meshes of {record['triangles']:,} triangles with "
        f"{record['pairs']:,} self-intersecting pairs, and {sum(record['broken']['impinge'].values())} files that hold no mesh which could be checked "
        f"(not a number, cut off, empty, faces of absent vertices). {record['date']}, {record['machine']}; seconds of one core, reading included. "
        f"[All classes of differences, each with an example](https://github.com/impinge-rs/impinge/blob/main/{path.with_suffix('.md').relative_to(ROOT)})."
    )
    rows = [row(record, of["contender"], of) for of in record["speed"]]
    lines = ["| " + " | ".join(cells) + " |" for cells in [HEAD, ["---", "---", *["---:"] * (len(HEAD) - 2)], *rows]]
    return said + "\n\n" + "\n".join(lines)


def main():
    page = PAGE.read_text(encoding="utf-8")
    new, n = TABLE.subn(lambda _: table(*newest()), page)
    if n != 1:
        sys.exit(f"{PAGE.name}: {n} tables between the marks, not 1")
    if "--check" not in sys.argv:
        PAGE.write_text(new, encoding="utf-8")
    elif new != page:
        sys.exit(f"{PAGE.relative_to(ROOT)} does not say what the newest record says: python bench/check_page.py")


if __name__ == "__main__":
    main()
