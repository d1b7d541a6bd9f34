"""What work costs: seconds on the clock, and the most memory that the process held meanwhile."""

from collections.abc import Callable
from pathlib import Path
from subprocess import DEVNULL, Popen
from time import perf_counter, sleep
from typing import Any, NamedTuple

import numpy as np

from workflows.evidence.accuracy.growth import growth_exponent

PROCESS = "/proc/self"
EVERY = 0.02  # s
TELLING = 1.5  # largest over smallest size, from which on an exponent means something
FORGET = "5"  # written to clear_refs it resets the peak


class Cost(NamedTuple):
    """Of one piece of work; bytes None where the system does not tell."""

    seconds: float
    bytes: float | None


def costed(call: Callable[[], Any]) -> tuple[Any, Cost]:
    """What a call returns, and what it took."""
    _forget_peak()
    started = perf_counter()
    result = call()
    return result, Cost(perf_counter() - started, _peak())


def cost_of_command(command: list[str], folder: Path) -> Cost | None:
    """Of another program; None where it failed."""
    started, held = perf_counter(), None
    # the system's own figure of an ended process begins with what its parent held
    with Popen(command, cwd=folder, stdout=DEVNULL, stderr=DEVNULL) as program:
        while program.poll() is None:
            held = _peak(f"/proc/{program.pid}") or held
            sleep(EVERY)
    return None if program.returncode else Cost(perf_counter() - started, held)


def _forget_peak() -> None:
    try:
        Path(PROCESS, "clear_refs").write_text(FORGET)
    except OSError:
        return


def _peak(process: str = PROCESS) -> float | None:
    """VmHWM: the largest resident set since it was last forgotten."""
    try:
        lines = Path(process, "status").read_text().splitlines()
    except OSError:
        return None
    return next((1024.0 * int(s.split()[1]) for s in lines if s.startswith("VmHWM:")), None)


class CostGrowth(NamedTuple):
    """Exponents of a stage's cost over the unknowns; nan or None where they are not told."""

    stage: str
    seconds: float
    bytes: float | None


def cost_growth(stage: str, costs: dict[int, Cost]) -> CostGrowth:
    """Of a stage's costs by the number of unknowns."""
    dofs = list(costs)
    if max(dofs) < TELLING * min(dofs):
        return CostGrowth(stage, np.nan, np.nan)
    seconds, held = zip(*costs.values(), strict=True)
    told = None not in held
    return CostGrowth(
        stage, growth_exponent(dofs, seconds), growth_exponent(dofs, held) if told else None
    )
