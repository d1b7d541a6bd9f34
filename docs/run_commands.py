"""Run what the pages show: each sh block's lines and each python block, page by page, and compare
what is printed with the text block below.

    python docs/run_commands.py               all pages, in an empty folder each
    python docs/run_commands.py impacts       some
    python docs/run_commands.py --write       and put what is printed into text blocks that differ

A line that fails ends it. Blocks of `console` are not run: they install, or need what is not here.
What a page leaves out by a line `...` is not compared, nor are columns, folds of lines, seconds and
megabytes; numbers are compared to a hundredth, errors within a factor alone, those in a column
`±` or `+-` too: an error is the difference of two runs, whose last digits another processor rounds
differently.
"""

import os
import re
import subprocess
import sys
from decimal import Decimal
from itertools import pairwise, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from beadwave.workflows.commands.terminal import LABEL, fold
from beadwave.workflows.report.summary_rows import ERRORS

DOCS = Path(__file__).parent
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.M | re.S)
# of stages: others each time
SECONDS = re.compile(r"^ +([\w -]+?  +\d+\.\d\d s( +\(kept\))?|seconds  .*)$")
# what a run took and what it used: others each time, or on another processor; a sentence may be
# folded before the unit
COST = re.compile(
    r"(?<![\w.])\d+(?:\.\d+)?(?: |\n +)(?:s|min|h|kB|MB|GB|evaluations|independent samples)\b"
)
# an error: behind ± or +- in any unit, a relative one by its name in the list of a run's errors
ERROR = re.compile(
    rf"(?:(?P<sign>±|\+-)|\b(?P<name>{'|'.join([*ERRORS, 'energy balance'])}))"
    r"\s(?P<value>\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?P<unit>(?(sign)(?:\s(?:%|ppm))?|\s(?:%|ppm)))"
)
TOKEN = re.compile(
    rf"{ERROR.pattern}"
    r"|(?<!\w)[-+]?\d+(?: \d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?:\s?%)?"  # a blank between thousands
    r"|\w+|(?P<repeated>[^\w\s])(?P=repeated)*"  # a word; a sign, or a rule of them
)
NUMBER = re.compile(r"[-+]?\d[\d .]*(?:e[-+]?\d+)?(?P<percent>\s?%)?")
ERROR_COLUMN = re.compile(r"(?:±|\+-)(?=  |$)")  # in the head of a table, whose cells end with it
LEFT_OUT = "..."  # a line in place of others
WIDTH = 100  # of sentences, as on a terminal; what the pages have room for
HEAD, TAIL = 18, 8  # lines of a long output that are shown
FEW = 4  # words by which a quoted stretch that is no longer printed is found, for the message


# allowed distance of a number from the one that a page quotes: of its value, other processors and
# libraries move errors of errors by that, results by less
RELATIVE = Decimal("0.01")
LAST_DIGITS = 1  # units in the last place, of numbers with a decimal point or exponent, and of %
POINTS = Decimal("0.01")  # of percentages: what the ratio of two such results may move by
ERROR_FACTOR = 1.5  # either way, of a stated error; 1.05 was seen between processors of two makers


class Token(NamedTuple):
    """A word, number or sign of a text, and the number of its line from 0."""

    text: str
    line: int


class Difference(NamedTuple):
    """Difference of a page from what is printed: both lines, and the number of the quoted one from
    0; a line that is not there is empty."""

    line: int
    quoted: str
    printed: str


def pages() -> dict[str, Path]:
    """The pages with blocks to run, by name."""
    documents = {path.stem: path for path in sorted(DOCS.glob("*.md"))}
    return {name: path for name, path in documents.items() if BLOCK.search(path.read_text())}


def is_slow(page: Path) -> bool:
    """True if it meshes an assembly, for minutes."""
    return page.read_text().startswith("---\nslow: true")


def run(page: Path, *, write: bool = False) -> list[str]:
    """Run the blocks of a page; a message for each text block that differs from what is printed,
    which replaces it if `write`. Raises CalledProcessError at the first block that fails."""
    text = page.read_text(encoding="utf-8")
    most = 10**6 if "\nwhole: true\n" in text else HEAD + TAIL
    messages: list[str] = []

    def compared(block: re.Match) -> str:
        """The block as it is, or with what is printed now where that differs."""
        language, code, quoted = block.groups()
        printed = _printed(language, code, Path(folder))
        if quoted is None:
            return block[0]
        difference = first_difference(quoted, printed)
        if difference is None:
            return block[0]
        line = text.count("\n", 0, block.start(3)) + 1 + difference.line
        messages.append(
            f"{page.name}, line {line}, is no longer what the commands above it print\n"
            f"  quoted: {difference.quoted or '(nothing)'}\n"
            f"  now:    {difference.printed or '(nothing)'}"
        )
        return f"```{language}\n{code}```\n\n```text\n{_shortened(printed, most)}```\n"

    with TemporaryDirectory() as folder:
        Path(folder, "examples").symlink_to(DOCS.parent / "examples")  # as in a checkout
        written = BLOCK.sub(compared, text)
    if write:
        page.write_text(written, encoding="utf-8")
    return messages


def _printed(language: str, code: str, folder: Path) -> str:
    bin_folder = Path(sys.executable).parent
    path = f"{bin_folder}{os.pathsep}{os.environ['PATH']}"
    command = ["sh", "-ec", code] if language == "sh" else [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False,
        env=os.environ | {"PATH": path},
    )  # fmt: skip
    if done.returncode:
        sys.stderr.write(f"{code}\n{done.stdout}\n{done.stderr}\n")
    done.check_returncode()
    return _without_seconds(done.stdout)


def first_difference(quoted: str, printed: str) -> Difference | None:
    """The first line of a quoted text that is not printed, or a printed one that is not quoted;
    None where they agree. A stretch behind a line `...` may stand anywhere after the one before
    it."""
    # stretches between what is left out: the first begins with the output, the last ends with it
    lines, ends = quoted.splitlines(), [-1]
    ends += [i for i, line in enumerate(lines) if line.strip() == LEFT_OUT] + [len(lines)]
    words = tokens(quoted)
    stretches = [[w for w in words if a < w.line < b] for a, b in pairwise(ends)]
    now = tokens(printed)

    # each stretch where it stands in what is printed, the first difference ends the comparison
    begin = 0
    for i, stretch in enumerate(stretches):
        last = i == len(stretches) - 1
        n, places = len(stretch), range(begin, len(now) - len(stretch) + 1)
        if 0 < i and last:
            places = places[-1:]
        if 0 < i:  # where it stands, or where its first words do
            whole = (p for p in places if _mismatch(stretch, now[p : p + n]) is None)
            few = stretch[:FEW]
            alike = (p for p in range(begin, len(now)) if _mismatch(few, now[p : p + FEW]) is None)
            begin = next(whole, next(alike, begin))
        beside = now[begin : None if last else begin + len(stretch)]
        k = _mismatch(stretch, beside)
        if k is not None:
            was = stretch[k] if k < len(stretch) else None
            new = beside[k] if k < len(beside) else None
            line = was.line if was else (stretch[-1].line + 1 if stretch else 0)
            return Difference(
                line,
                quoted.splitlines()[was.line].strip() if was else "",
                printed.splitlines()[new.line].strip() if new else "",
            )
        begin += len(stretch)
    return None


def tokens(text: str) -> list[Token]:
    """Words, numbers and signs of a text, costs left out; a rule of signs counts as three, a number
    in a column of errors is one."""
    tokens: list[Token] = []
    timed, error_columns = False, set[int]()
    text = COST.sub(lambda cost: "\n" * cost[0].count("\n"), text)
    for line, content in enumerate(text.splitlines()):
        if not content.strip():  # the end of a table
            timed, error_columns = False, set()
        if timed:  # a row of a table whose last column is the seconds that each took
            content = content.rstrip().rpartition(" ")[0]
        timed = timed or content.endswith("  seconds")
        for match in TOKEN.finditer(content):
            word = match[0] if match[0][:3] != 3 * match[0][0] else match[0][:3]
            is_error = match.end() in error_columns and NUMBER.fullmatch(word)
            tokens.append(Token(f"± {word}" if is_error else word, line))
        error_columns |= {match.end() for match in ERROR_COLUMN.finditer(content)}
    return tokens


def _mismatch(quoted: list[Token], printed: list[Token]) -> int | None:
    """The first place at which two lists of tokens differ."""
    pairs = zip_longest(quoted, printed)
    return next(
        (k for k, (a, b) in enumerate(pairs) if not (a and b and _same(a.text, b.text))), None
    )


def _same(quoted: str, printed: str) -> bool:
    if quoted == printed:
        return True
    errors = ERROR.fullmatch(quoted), ERROR.fullmatch(printed)
    if all(errors):
        scale = {"": 1.0, "%": 1e-2, "ppm": 1e-6}
        a, b = (float(e["value"]) * scale[e["unit"].strip()] for e in errors)
        near = max(a, b) <= ERROR_FACTOR * min(a, b)
        return errors[0]["name"] == errors[1]["name"] and near
    numbers = NUMBER.fullmatch(quoted), NUMBER.fullmatch(printed)
    if not all(numbers) or (numbers[0]["percent"] is None) != (numbers[1]["percent"] is None):
        return False
    a, b = (Decimal(text.replace(" ", "").removesuffix("%")) for text in (quoted, printed))
    allowed = [RELATIVE * max(abs(a), abs(b))]
    if set(quoted) & set(".e%"):  # no count
        allowed.append(LAST_DIGITS * Decimal(10) ** a.as_tuple().exponent)
    if "%" in quoted:
        allowed.append(POINTS)
    return abs(a - b) <= max(allowed)


def _without_seconds(output: str) -> str:
    """The output with its sentences folded, and without rows of seconds."""
    lines: list[str] = []
    of_seconds = False
    whole = (line if line.startswith(" ") else fold(line, WIDTH) for line in output.splitlines())
    for line in "\n".join(whole).splitlines():
        # a row of seconds, and the lines in which it goes on
        of_seconds = bool(SECONDS.match(line)) or (of_seconds and line.startswith(" " * LABEL))
        if not of_seconds:
            lines.append(line)
    return "".join(f"{line}\n" for line in lines)


def _shortened(output: str, most: int) -> str:
    lines = output.splitlines()
    if len(lines) > most:
        end = len(lines) - TAIL
        while re.match(r"  \S", lines[end]) and end > HEAD:  # a sentence goes on there
            end -= 1
        lines = [*lines[:HEAD], LEFT_OUT, *lines[end:]]
    return "".join(f"{line}\n" for line in lines)


def main() -> int:
    """All pages, or those named; exit status 1 if a page quotes what is no longer printed."""
    names, write = [name for name in sys.argv[1:] if name != "--write"], "--write" in sys.argv
    unknown = sorted(set(names) - set(pages()))
    if unknown:
        print(f"{unknown[0]}: no such page; take of {', '.join(pages())}", file=sys.stderr)
        return 2
    messages = []
    for name, page in pages().items():
        if name in names or not names:
            print(f"running the commands of {page.name}", flush=True)
            of_page = run(page, write=write)
            print("\n".join(of_page), end="\n" if of_page else "", flush=True)
            messages += of_page
    if messages and not write:
        print(
            f"{len(messages)} text blocks are no longer what their commands print; "
            "docs/run_commands.py --write PAGE puts it there, then read the sentences around it",
            file=sys.stderr,
        )
    return int(bool(messages) and not write)


if __name__ == "__main__":
    sys.exit(main())
