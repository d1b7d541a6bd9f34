"""Where and with what the times of an accuracy study were taken."""

import platform
from datetime import UTC, datetime
from os import cpu_count
from pathlib import Path
from typing import NamedTuple

from workflows.stages.cache import LIBRARIES, library_versions


class Machine(NamedTuple):
    """The machine that a study ran on: processor, system, versions."""

    processor: str
    cores: int
    system: str
    python: str
    taken: str  # UTC, to the second
    libraries: dict[str, str]


def machine() -> Machine:
    """This one; the processor by its model's name where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    except OSError:
        models = [platform.processor()] if platform.processor() else []
    return Machine(
        processor=models[0] if models else platform.machine(),
        cores=cpu_count() or 1,
        system=platform.platform(),
        python=platform.python_version(),
        taken=datetime.now(UTC).isoformat(timespec="seconds"),
        libraries=library_versions(("beadwave", *LIBRARIES, "scikit-sundae")),
    )
