"""Puts the rows of `beadwave verify --out DIR` and of `pytest tests/verify --rows FILE` into
docs/verify.md, a table for each group or file of tests.

python docs/verify_tables.py DIR/verify.csv FILE
"""

import csv
import re
import sys
from itertools import groupby
from operator import itemgetter
from pathlib import Path

PAGE = Path(__file__).with_name("verify.md")
BEGIN, END = "<!-- rows -->\n", "<!-- end of rows -->"
HEADING = "| quantity | ours | theirs | difference | allowed |\n|---|---:|---:|---:|---:|\n"


def tables(rows: list[dict[str, str]]) -> str:
    """Markdown, in the rows' order."""
    return "".join(_table(group, [*of]) for group, of in groupby(rows, itemgetter("group")))


def _table(group: str, rows: list[dict[str, str]]) -> str:
    seconds = sum(float(row["seconds"]) for row in rows)
    lines = "\n".join(map(_line, rows))
    return f"\n**{group}** ({seconds:.0f} s)\n\n{HEADING}{lines}\n"


def _line(row: dict[str, str]) -> str:
    name = re.sub(r"([|*_])", r"\\\1", row["quantity"])
    mark = "" if row["verdict"] == "within" else f" ({row['verdict']})"
    ours, theirs = (_number(row[key], 7) for key in ("ours", "theirs"))
    difference, allowed = (_number(row[key], 3) for key in ("difference", "allowed"))
    return f"| {name}{mark} | {ours} | {theirs} | {difference} | {allowed} |"


def _number(text: str, digits: int) -> str:
    return "-" if text in ("", "nan") else f"{float(text):.{digits}g}"


if __name__ == "__main__":
    rows = []
    for path in sys.argv[1:]:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows += csv.DictReader(file)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}{tables(rows)}\n{END}{after}", encoding="utf-8")
