"""Progress of a command on stderr, bars on a terminal and lines in a pipe; its result on stdout."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any

from beadwave.workflows.report.stage_words import stage_words

if TYPE_CHECKING:
    from rich.progress import TaskID

    from beadwave.workflows.report.summary import Summary

BAR = 16  # characters of a bar: name, bar and times fit 80 columns
LABEL = 35  # characters of a label
LINE = 80  # of a line
UNBROKEN = "\u00a0"
PATIENCE = 1.0  # s that a stage runs before a line says so where stderr is no terminal


class StageProgress:
    """A bar per stage on a terminal; elsewhere a line for each that takes over a second; nothing
    with `quiet`."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._bars = None
        if sys.stderr.isatty() and not quiet:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            # a print goes above the bars where it is seen on the same terminal, and to its file
            # otherwise
            self._bars = Progress(
                TextColumn("{task.description:>26}"), BarColumn(BAR), TimeElapsedColumn(),
                TextColumn("{task.fields[remaining]}"), console=Console(file=sys.stderr),
                redirect_stdout=sys.stdout.isatty(),
            )  # fmt: skip
        self._has_lines = self._bars is None and not quiet
        self._hint = " (--quiet: no progress, no text)"  # of the first line

    def __enter__(self) -> StageProgress:
        if self._bars:
            self._bars.start()
        return self

    def __exit__(self, *_) -> None:
        if self._bars:
            self._bars.stop()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Show a stage as running, then as done."""
        with self._shown(name):
            yield

    @contextmanager
    def counted(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Show work that says how many of its pieces are done, and of how many."""

        def count(n_done: int, n: int) -> None:
            if self._bars and task is not None:
                description = f"{name}: {n_done} of {n}"
                self._bars.update(task, total=n, completed=n_done, description=description)
                seconds = self._bars.tasks[task].time_remaining
                remaining = "" if seconds is None else f"{seconds:.0f} s left"
                self._bars.update(task, remaining=remaining)

        with self._shown(name) as task:
            yield count

    @contextmanager
    def _shown(self, name: str) -> Iterator[TaskID | None]:
        """A bar, whose number comes out, or a line after a second."""
        task, timer, words = None, None, stage_words(name)
        if self._bars:
            task = self._bars.add_task(words, total=None, remaining="")
        elif self._has_lines:
            timer = Timer(PATIENCE, self._print_line, (words,))
            timer.daemon = True
            timer.start()
        try:
            yield task
        finally:
            if timer:
                timer.cancel()
        if self._bars and task is not None:
            self._bars.update(task, total=1, completed=1, remaining="")

    def _print_line(self, name: str) -> None:
        """A line on a stage that is running."""
        hint, self._hint = self._hint, ""
        print(f"beadwave: now {name}{hint}.", file=sys.stderr, flush=True)


def folded(text: str, stream: Any = None) -> str:
    """The text with sentences that are longer than a line of the terminal folded between words;
    columns of tables, and all of it where the stream (stdout) is no terminal, stay as they are."""
    from shutil import get_terminal_size

    stream = stream or sys.stdout
    if stream is None or not stream.isatty():
        return text
    return fold(text, get_terminal_size().columns)


def fold(text: str, width: int) -> str:
    """The text with sentences longer than `width` folded between words; columns stay."""
    from textwrap import fill

    return "\n".join(
        line if len(line) <= width or "  " in line.strip()
        else fill(line, width, subsequent_indent="  ", break_long_words=False,
                  break_on_hyphens=False)
        for line in text.split("\n")
    )  # fmt: skip


def print_result(content: dict, text: str, json: bool, quiet: bool = False) -> None:
    """A result on stdout: JSON for machines, or lines for a person."""
    from json import dumps

    if json or not quiet:
        print(dumps(content, indent=2, allow_nan=False) if json else folded(text))


def print_report(report: Any, json: bool, quiet: bool = False) -> None:
    """A report that knows both forms: its JSON, or its text."""
    if json or not quiet:
        print(report.model_dump_json(indent=2) if json else folded(report.text()))


def print_notes(notes: Iterable[str]) -> None:
    """Sentences on stderr, with --json and --quiet too."""
    for note in notes:
        print(folded(note, sys.stderr), file=sys.stderr)


def print_lines(*lines: str, json: bool = False, quiet: bool = False) -> None:
    """Lines after a result, for a person alone."""
    for line in lines if not (json or quiet) else ():
        print(line)


def print_files(paths: Iterable[Path], json: bool, quiet: bool = False, **more: Any) -> None:
    """The files that a command has written, in JSON with `more`."""
    names = [str(path) for path in paths]
    print_result({"written": names} | more, f"written: {', '.join(names)}", json, quiet)


class SummaryPrinter:
    """The summary on stdout: lines for a person, or JSON for machines; warnings on stderr. Waves
    are printed as soon as they are known as well: where stdout is no terminal to stderr, so that a
    file holds each number once, with its error."""

    def __init__(self, *, json: bool, quiet: bool, verbose: bool) -> None:
        self._json, self._quiet, self._verbose = json, quiet, verbose
        self._printed: set[tuple[str, str]] = set()

    def waves(self, summary: Summary) -> None:
        """Print what is known before errors are estimated and pictures drawn."""
        if not self._json and not self._quiet:
            from beadwave.workflows.report.summary_rows import results

            if sys.stdout.isatty():
                self._print(results(summary))
            else:
                print(*map(_row, results(summary)), sep="\n", file=sys.stderr, flush=True)

    def whole(self, summary: Summary) -> None:
        """Print the rest."""
        if self._json:
            print(summary.text(), end="")
            return
        if not self._quiet:
            from beadwave.workflows.report.summary_rows import details, headline, left_out

            rows = list(headline(summary))
            if self._verbose:
                rows += details(summary)
                sentences = summary.verdict
                rows += [("verdict", sentence) for sentence in sentences]
                for stage in summary.stages:
                    cached = "  (kept)" if stage.cached else ""
                    rows.append((stage_words(stage.name), f"{stage.seconds:.2f} s{cached}"))
            else:
                rows += left_out(summary)
            self._print(rows)
        for warning in summary.warnings:
            print(folded(f"warning: {warning}", sys.stderr), file=sys.stderr)

    def _print(self, rows: Iterable[tuple[str, str]]) -> None:
        for row in rows:
            if row not in self._printed:
                print(_row(row), flush=True)
                self._printed.add(row)


def _row(row: tuple[str, str]) -> str:
    """A label and its value, wrapped between parts."""
    from textwrap import fill

    text = fill(f"{row[0]:>{LABEL}}  {row[1]}", LINE, subsequent_indent=" " * (LABEL + 2))
    return text.replace(UNBROKEN, " ")
