"""What a person sees while a command goes on and when it is done; a pipe gets the end only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING

from workflows.commands.durations import Durations

if TYPE_CHECKING:
    from workflows.report.summary import Summary

LABEL = 35  # characters of a label
LINE = 80  # of a line
UNBROKEN = "\u00a0"
PATIENCE = 10.0  # s without a word where nobody watches a terminal


class StageProgress:
    """A bar per stage on a terminal; elsewhere a line after ten seconds; nothing with `quiet`.

    `command` names what runs: how long its stages took tells the next time how long they will.
    """

    def __init__(self, command: str = "", *, quiet: bool = False) -> None:
        watched = sys.stderr.isatty()
        self._durations = Durations(command)
        self._bars = _bars() if watched and not quiet else None
        self._timer = None if watched or quiet else Timer(PATIENCE, self._tell)
        self._running: list[str] = []

    def __enter__(self) -> StageProgress:
        if self._bars:
            self._bars.start()
        if self._timer:
            self._timer.daemon = True
            self._timer.start()
        return self

    def __exit__(self, *_) -> None:
        if self._timer:
            self._timer.cancel()
        if self._bars:
            self._bars.stop()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Show a stage as running, then as done."""
        expected = self._durations.expected(name)
        task = self._bars.add_task(name, total=None, expected=expected) if self._bars else None
        self._running.append(name)
        try:
            with self._durations.measured(name):
                yield
        finally:
            self._running.remove(name)
        if self._bars:
            self._bars.update(task, total=1, completed=1)

    @contextmanager
    def counted(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Show work that says how many of its pieces are done, and of how many."""
        task = self._bars.add_task(name, total=None, expected=None) if self._bars else None
        self._running.append(name)
        first: list[int] = []  # pieces that were done before

        def told(done: int, n: int) -> None:
            first[:] = first or [done]
            fresh = done - first[0]
            if self._bars and fresh:
                elapsed = self._bars.tasks[task].elapsed or 0.0
                left = elapsed * (n - done) / fresh
                said = f"{name}: {done} of {n}"
                self._bars.update(task, expected=elapsed + left, description=said)

        yield told
        self._running.remove(name)
        if self._bars:
            self._bars.update(task, total=1, completed=1)

    def _tell(self) -> None:
        told = self._durations.told(self._running[-1] if self._running else "the command")
        print(f"beadwave: {told}; --quiet drops this line.", file=sys.stderr)


def _bars():
    from rich.console import Console

    from workflows.commands.bars import progress

    return progress(Console(file=sys.stderr))


def told(content: dict, text: str, json: bool, quiet: bool = False) -> None:
    """A result on stdout: JSON for machines, or lines for a person."""
    from json import dumps

    if json or not quiet:
        print(dumps(content, indent=2, allow_nan=False) if json else text)


def shown(found, json: bool, quiet: bool = False) -> None:
    """A report that knows both forms: its JSON, or its text."""
    if json or not quiet:
        print(found.model_dump_json(indent=2) if json else found.text())


def warned(notes: Iterable[str]) -> None:
    """Sentences on stderr that a user is to see, whatever is printed."""
    for note in notes:
        print(note, file=sys.stderr)


def noted(*lines: str, json: bool = False, quiet: bool = False) -> None:
    """Lines after a result, for a person alone."""
    for line in lines if not (json or quiet) else ():
        print(line)


def written(paths: Iterable[Path], json: bool, quiet: bool = False) -> None:
    """The files that a command has made."""
    names = [str(path) for path in paths]
    told({"written": names}, f"written: {', '.join(names)}", json, quiet)


def printed(summary: Summary, json: bool, quiet: bool = False, verbose: bool = False) -> None:
    """The summary on stdout: JSON for machines, lines for a person; warnings on stderr."""
    if json:
        print(summary.text(), end="")
        return
    if not quiet:
        _print_lines(summary, verbose)
    for warning in summary.warnings:
        print(f"warning: {warning}", file=sys.stderr)


def _print_lines(summary: Summary, verbose: bool) -> None:
    from workflows.report.rows import details, headline

    for label, value in (*headline(summary), *(details(summary) if verbose else ())):
        print(_wrapped(label, value))
    if not verbose:
        return
    for sentence in (*summary.verdict, *summary.wall_modes_left_out[-1:]):
        print(_wrapped("verdict", sentence))
    for stage in summary.stages:
        kept = "  (kept)" if stage.cached else ""
        print(_wrapped(stage.name, f"{stage.seconds:.2f} s{kept}"))


def _wrapped(label: str, value: str) -> str:
    from textwrap import fill

    text = fill(f"{label:>{LABEL}}  {value}", LINE, subsequent_indent=" " * (LABEL + 2))
    return text.replace(UNBROKEN, " ")
