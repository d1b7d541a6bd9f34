"""Where and with what the times of an accuracy study were taken."""

import platform
from datetime import UTC, datetime
from os import cpu_count
from pathlib import Path
from typing import NamedTuple

from workflows.stages.pipeline import LIBRARIES, library_versions


class Machine(NamedTuple):
    """Processor, system and versions."""

    processor: str
    cores: int
    system: str
    python: str
    taken: str
    libraries: dict[str, str]


def machine() -> Machine:
    """This one."""
    return Machine(
        processor=_processor(),
        cores=cpu_count() or 1,
        system=platform.platform(),
        python=platform.python_version(),
        taken=datetime.now(UTC).isoformat(timespec="seconds"),
        libraries=library_versions(("beadwave", *LIBRARIES, "scikit-sundae")),
    )


def _processor() -> str:
    """The model's name where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
