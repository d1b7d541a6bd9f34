"""Run what the pages show: each sh block's lines and each python block, page by page.

    python docs/run_commands.py               all pages, in an empty folder each
    python docs/run_commands.py impacts       some
    python docs/run_commands.py --write       and put what is printed into the text blocks below

A line that fails ends it. Blocks of `console` are not run: they install, or need what is not here.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from workflows.commands.terminal import LABEL, fold

DOCS = Path(__file__).parent
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.M | re.S)
# of stages: others each time
SECONDS = re.compile(r"^ +([\w -]+?  +\d+\.\d\d s( +\(kept\))?|seconds  .*)$")
WIDTH = 100  # of sentences, as on a terminal; what the pages have room for
HEAD, TAIL = 18, 8  # lines of a long output that are shown


def pages() -> dict[str, Path]:
    """The pages with blocks to run, by name."""
    documents = {path.stem: path for path in sorted(DOCS.glob("*.md"))}
    return {name: path for name, path in documents.items() if BLOCK.search(path.read_text())}


def is_slow(page: Path) -> bool:
    """Whether it meshes an assembly, for minutes."""
    return page.read_text().startswith("---\nslow: true")


def run(page: Path, *, write: bool = False) -> None:
    """Run the blocks of a page; raises CalledProcessError at the first that fails."""
    text = page.read_text(encoding="utf-8")
    most = 10**6 if "\nwhole: true\n" in text else HEAD + TAIL
    with TemporaryDirectory() as folder:
        Path(folder, "examples").symlink_to(DOCS.parent / "examples")  # as in a checkout
        written = BLOCK.sub(lambda block: _block(block, Path(folder), most), text)
    if write:
        page.write_text(written, encoding="utf-8")


def _block(block: re.Match, folder: Path, most: int) -> str:
    language, code, output = block.groups()
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
    source = f"```{language}\n{code}```\n"
    return source if output is None else f"{source}\n```text\n{_shortened(done.stdout, most)}```\n"


def _shortened(output: str, most: int) -> str:
    lines: list[str] = []
    of_seconds = False
    whole = (line if line.startswith(" ") else fold(line, WIDTH) for line in output.splitlines())
    for line in "\n".join(whole).splitlines():
        # a row of seconds, and the lines in which it goes on
        of_seconds = bool(SECONDS.match(line)) or (of_seconds and line.startswith(" " * LABEL))
        if not of_seconds:
            lines.append(line)
    if len(lines) > most:
        lines = [*lines[:HEAD], "...", *lines[-TAIL:]]
    return "".join(f"{line}\n" for line in lines)


def main() -> None:
    """All pages, or those named."""
    names = [name for name in sys.argv[1:] if name != "--write"]
    for name, page in pages().items():
        if name in names or not names:
            print(f"running the commands of {page.name}", flush=True)
            run(page, write="--write" in sys.argv)


if __name__ == "__main__":
    main()
