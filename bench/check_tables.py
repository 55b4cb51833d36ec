"""The tables of `check.py`, as Markdown."""

import collections

import check_dataset


def outcome(answer):
    """What a contestant says about a file that cannot be checked."""
    if answer is None:
        return "not asked"
    if "failed" in answer:
        return answer["failed"]
    if "seconds" not in answer:
        return "error"
    return "error" if answer["errors"] else "counts"


def number(x):
    return f"{x:,.0f}" if x >= 100 else f"{x:.2g}" if x < 10 else f"{x:.0f}"


def speed_table(rows):
    lines = [
        "| | files | triangles | read, s | counts, s | self-intersections, s | all, s | meshes/s | triangles/s | impinge on the same files, s | times impinge | lost |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for row in rows:
        steps = [f"{row['steps'][step]:.2f}" if step in row["steps"] else "" for step in ["read", "counts", "self"]]
        seconds = row["seconds"]
        cells = [row["contender"], f"{row['files']:,}", f"{row['triangles']:,}", *steps, f"{seconds:.2f}"]
        cells += [f"{row['files'] / seconds:,.0f}", f"{row['triangles'] / seconds:,.0f}"]
        cells += [f"{row['ours']:.2f}", f"{seconds / row['ours']:.1f}", row["lost"]]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def broken_table(files, columns):
    """What contestants say about files that hold no mesh which could be checked."""
    lines = ["| files with | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for kind in check_dataset.BROKEN:
        cells = [kind]
        for answers in columns.values():
            said = collections.Counter(outcome(answers.get(file.path)) for file in files if file.kind == kind)
            cells.append(", ".join(f"{word} {n}" for word, n in said.most_common()))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def broken_counts(files, columns):
    """The same for all such files together: a number per outcome."""
    broken = [file.path for file in files if not file.is_good]
    return {label: collections.Counter(outcome(answers.get(path)) for path in broken) for label, answers in columns.items()}


def self_table(compared):
    lines = [
        "| | files compared | the same | difference | pairs or faces | files | for example |",
        "|---|---:|---:|---|---:|---:|---|",
    ]
    for label, (agree, classes) in compared.items():
        head = [label, f"{agree['files']:,}", f"{agree['same']:,}"]
        for name, entry in classes.items() or [("none", {"n": 0, "files": 0, "example": ""})]:
            cells = [*head, name, f"{entry['n']:,}", f"{entry['files']:,}", entry["example"]]
            lines.append("| " + " | ".join(cells) + " |")
            head = ["", "", ""]
        for name, n in agree["reader"].items():
            lines.append(f"| | | | (reader: {name}) | | {n:,} | |")
    return "\n".join(lines)


def summary_table(compared):
    """The classes of differences, added up by who is right."""
    ends = {
        "another definition": "another definition",
        "peer misses": "misses true ones",
        "peer reports": "reports false ones",
        "peer says": "wrong yes or no",
    }
    ends |= {"not decided": "not decided", "IMPINGE": "impinge is wrong"}
    lines = ["| | files | the same | some answer wrong | " + " | ".join(ends.values()) + " |", "|---|---:|---:|---:" + "|---:" * len(ends) + "|"]
    for label, (agree, classes) in compared.items():
        cells = [label, f"{agree['files']:,}", f"{agree['same']:,}", f"{agree['wrong']:,}"]
        for end in ends:
            cells.append(f"{sum(entry['n'] for name, entry in classes.items() if name.startswith(end)):,}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def counts_table(compared):
    lines = [
        "| | question | files | the same | another definition, and which | unexplained | for example |",
        "|---|---|---:|---:|---|---:|---|",
    ]
    for label, (tallies, examples) in compared.items():
        for question, tally in tallies.items():
            n = sum(tally.values())
            if not n:
                continue
            names = [name for name, _ in tally.most_common() if name not in ["same", "unexplained"]]
            others = "; ".join(f"{tally[name]:,} {name}" for name in names)
            shown = [examples[question, name] for name in ["unexplained", *names] if (question, name) in examples]
            cells = [label, question, f"{n:,}", f"{tally['same']:,}", others, f"{tally['unexplained']:,}"]
            lines.append("| " + " | ".join([*cells, shown[0] if shown else ""]) + " |")
    return "\n".join(lines)
