"""What work costs: seconds on the clock and of the processor, and the most memory meanwhile."""

from collections.abc import Callable
from pathlib import Path
from subprocess import DEVNULL, Popen
from time import perf_counter, process_time, sleep
from typing import Any, NamedTuple

import numpy as np

from beadwave.system import children_seconds, peak_memory, reset_peak_memory
from beadwave.workflows.evidence.accuracy.growth import growth_exponent


class Seconds(NamedTuple):
    """Of one call: on the clock, and of the processor, which other work on the machine spoils
    least; that of this process and its ended children."""

    clock: float
    processor: float


class Timed(NamedTuple):
    """A result, the seconds of its first call, and of the quickest of some later ones."""

    result: Any
    warm: Seconds
    cold: Seconds


def timed(
    call: Callable[[], Any], *, budget: float = 0.1, repeats: int = 30, slow: float = np.inf
) -> Timed:
    """Call once, which may compile, then again while the budget [s] lasts; a first call of `slow`
    seconds is its own warm time."""

    def once() -> tuple[Any, Seconds]:
        """A result, and what it took on the clock and of the processor."""
        processor, clock = processor_seconds(), perf_counter()
        result = call()
        clock = perf_counter() - clock
        return result, Seconds(clock, processor_seconds() - processor)

    result, cold = once()
    warm: list[Seconds] = []
    while cold.clock < slow and len(warm) < repeats and sum(s.clock for s in warm) < budget:
        warm.append(once()[1])
    return Timed(result, min(warm, default=cold), cold)


def least_seconds(calls: tuple[Callable[[], object], ...], repeats: int) -> list[float]:
    """Processor seconds of the quickest of some runs of every call, the calls in turns."""
    turns = [[timed(call, repeats=0).cold.processor for call in calls] for _ in range(repeats)]
    return np.min(turns, axis=0).tolist()


def processor_seconds() -> float:
    """Of this process and its ended children."""
    return process_time() + children_seconds()


class Cost(NamedTuple):
    """Of one piece of work; bytes None where the system does not tell."""

    seconds: float
    bytes: float | None  # largest resident set


def costed(call: Callable[[], Any]) -> tuple[Any, Cost]:
    """The value of a call, its seconds and its peak memory."""
    reset_peak_memory()
    started = perf_counter()
    result = call()
    return result, Cost(perf_counter() - started, peak_memory())


def cost_of_command(command: list[str], folder: Path) -> Cost | None:
    """Of another program; None where it failed.

    Its peak is read while it runs, every 20 ms: the system's own figure of an ended process begins
    with what its parent held.
    """
    started, largest = perf_counter(), None
    with Popen(command, cwd=folder, stdout=DEVNULL, stderr=DEVNULL) as program:
        while program.poll() is None:
            largest = peak_memory(program.pid) or largest
            sleep(0.02)
    return None if program.returncode else Cost(perf_counter() - started, largest)


class CostGrowth(NamedTuple):
    """Exponents of a stage's cost over the unknowns; nan where the sizes are too alike to tell
    them, None for the bytes where the system does not tell those."""

    stage: str
    seconds: float
    bytes: float | None


def cost_growth(stage: str, costs: dict[int, Cost]) -> CostGrowth:
    """Exponents of a stage's costs by the number of unknowns."""
    dofs = list(costs)
    if max(dofs) < 1.5 * min(dofs):  # an exponent over less would be that of the noise
        return CostGrowth(stage, np.nan, np.nan)
    seconds, peaks = zip(*costs.values(), strict=True)
    memory = None if None in peaks else growth_exponent(dofs, peaks)
    return CostGrowth(stage, growth_exponent(dofs, seconds), memory)
