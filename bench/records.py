"""Where the benches in Python keep their records: a folder per machine and date."""

import json
import os
import pathlib
import platform
import re

ROOT = pathlib.Path(__file__).resolve().parents[1]


def machine():
    """The processor's name and its number of threads."""
    model = platform.processor() or platform.machine()
    try:
        cpuinfo = pathlib.Path("/proc/cpuinfo").read_text()
        model = re.search(r"model name\s*: (.*)", cpuinfo)[1]
    except (OSError, TypeError):
        pass
    return f"{model}, {os.cpu_count()} threads, {platform.system()}"


def write_record(machine, date, name, text, record):
    """Writes a record as text and as JSON. Returns the folder of the machine's records of that date, which is created if it is absent."""
    slug = re.sub(r"[^a-z0-9]+", "-", machine.lower()).strip("-")
    folder = ROOT / "bench" / "record" / f"{slug}-{date}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    (folder / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")
    return folder
