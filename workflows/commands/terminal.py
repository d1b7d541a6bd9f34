"""What a person sees while a run goes on and when it is done; a pipe gets the end only."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from json import dumps
from pathlib import Path
from textwrap import fill
from typing import TextIO

import typer

from workflows.results.summary import Summary, rows
from workflows.results.tables import LINE

LABEL = 34  # characters of a label
UNBROKEN = "\u00a0"


class StageProgress:
    """A bar per stage on a terminal, nothing elsewhere."""

    def __init__(self, stream: TextIO) -> None:
        self._bars = _bars(stream) if stream.isatty() else None

    def __enter__(self) -> "StageProgress":
        if self._bars:
            self._bars.start()
        return self

    def __exit__(self, *_) -> None:
        if self._bars:
            self._bars.stop()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Show a stage as running, then as done."""
        task = self._bars.add_task(name, total=None) if self._bars else None
        yield
        if self._bars:
            self._bars.update(task, total=1, completed=1)


def _bars(stream: TextIO):
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description:>20}"), BarColumn(bar_width=24), TimeElapsedColumn()
    return Progress(*columns, console=Console(file=stream))


def told(content: dict, text: str, json: bool) -> None:
    """A result on stdout: JSON for machines, or lines for a person."""
    typer.echo(dumps(content, indent=2, allow_nan=False) if json else text)


def written(paths: Iterable[Path], json: bool) -> None:
    """The files that a command has made."""
    names = [str(path) for path in paths]
    told({"written": names}, f"written: {', '.join(names)}", json)


def printed(summary: Summary, json: bool) -> None:
    """The summary on stdout: JSON for machines, lines for a person; warnings on stderr."""
    if json:
        typer.echo(summary.text(), nl=False)
        return
    for label, value in [("scene", summary.scene), *rows(summary), *_waves(summary)]:
        typer.echo(_wrapped(label, value))
    for sentence in (*summary.verdict, *summary.wall_modes_left_out[-1:]):
        typer.echo(_wrapped("verdict", sentence))
    for stage in summary.stages:
        kept = "  (kept)" if stage.cached else ""
        typer.echo(f"{stage.name:>34}  {stage.seconds:.2f} s{kept}")
    for warning in summary.warnings:
        typer.echo(f"warning: {warning}", err=True)


def _waves(summary: Summary) -> list[tuple[str, str]]:
    return [
        (f"waves at sphere {sphere}", ", ".join(_arrival(a) for a in waves.arrivals) or "none")
        for sphere, waves in summary.waves.items()
    ]


def _arrival(arrival) -> str:
    """In a line of its own or with others, never on two."""
    name = f"{arrival.name} " if arrival.name else ""
    said = f"{name}{arrival.peak_velocity_m_s:+.3g} m/s at {1e3 * arrival.time_s:.4g} ms"
    return said.replace(" ", UNBROKEN)


def _wrapped(label: str, value: str) -> str:
    text = fill(f"{label:>{LABEL}}  {value}", LINE, subsequent_indent=" " * (LABEL + 2))
    return text.replace(UNBROKEN, " ")
