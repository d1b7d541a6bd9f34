"""Progress bars of stages on a terminal, filled by the time that a stage took in an earlier run."""

import sys

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task, TextColumn
from rich.progress_bar import ProgressBar
from rich.text import Text

WIDTH = 16  # characters of a bar: name, bar and times fit 80 columns
FULLEST = 0.97  # of a bar whose stage still runs


class _Bar(ProgressColumn):
    """Elapsed over expected; a pulse where no duration is known."""

    def render(self, task: Task) -> ProgressBar:
        expected, elapsed = task.fields["expected"], task.elapsed or 0.0
        if task.finished:
            return ProgressBar(total=1, completed=1, width=WIDTH)
        if not expected or elapsed > expected:
            return ProgressBar(total=None, pulse=True, width=WIDTH)
        return ProgressBar(total=expected, completed=min(elapsed, FULLEST * expected), width=WIDTH)


class _Time(ProgressColumn):
    """Seconds so far, and those that are left of the stage and of the command."""

    def render(self, task: Task) -> Text:
        expected, elapsed = task.fields["expected"], task.elapsed or 0.0
        if task.finished:  # `elapsed` runs on
            return Text(f"{task.finished_time or 0.0:.1f} s")
        if not expected:
            return Text(f"{elapsed:.1f} s")
        left = task.fields["left"]()
        # the end of the command only where it is not that of the stage
        of_all = f", {left:.0f} s to the end" if left and left > expected - elapsed + 1 else ""
        if elapsed > expected:
            return Text(f"{elapsed:.0f} s{of_all or ', longer than foreseen'}")
        share = 100 * min(elapsed / expected, FULLEST)
        return Text(f"{share:2.0f} %, {expected - elapsed:.0f} s left{of_all}")


def progress(console: Console) -> Progress:
    """A line per stage: name, bar, time."""
    # a print goes above the bars where it is seen on the same terminal, and to its file otherwise
    return Progress(
        TextColumn("{task.description:>26}"), _Bar(), _Time(), console=console,
        redirect_stdout=sys.stdout.isatty(),
    )  # fmt: skip
