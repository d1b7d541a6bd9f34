"""Memory that this process may still take: of the machine, of its control group, of its limits.

A container's limit is in its control group and in no figure of the machine; memory that the group
uses for cached files is given back on demand.
"""

from collections.abc import Iterator
from pathlib import Path
from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit

GROUPS = Path("/sys/fs/cgroup")
NAMES = {  # files of a group's limit and use, and the key of cached files in its memory.stat
    "": ("memory.max", "memory.current", "inactive_file"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}


def free_memory() -> float:
    """Bytes that can still be taken; inf where the system does not say."""
    return max(0.0, min((*_of_machine(), *_of_groups(), *_of_limits()), default=float("inf")))


def _of_machine(proc: Path = Path("/proc")) -> Iterator[float]:
    """Bytes that the machine can still give; none where it does not say so."""
    for line in _text(proc / "meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            yield 1024.0 * int(line.split()[1])


def _of_groups(groups: Path = GROUPS, mine: Path = Path("/proc/self/cgroup")) -> Iterator[float]:
    """Bytes left in the process's control group and in those above it, of version 1 or 2: limit
    less use, and the cached files that the system gives back on demand."""
    for line in _text(mine).splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers not in NAMES:
            continue
        limit_file, used_file, cached = NAMES[controllers]
        root = groups / controllers
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            if not folder.is_relative_to(root):
                continue
            limit, used = _text(folder / limit_file).strip(), _text(folder / used_file).strip()
            if limit.isdigit() and used.isdigit():  # "max" stands for no limit
                stat = dict(line.split() for line in _text(folder / "memory.stat").splitlines())
                yield float(limit) - float(used) + float(stat.get(cached, 0))


def _of_limits() -> Iterator[float]:
    """Bytes up to the limit of this process' addresses; none without a limit."""
    limit, _ = getrlimit(RLIMIT_AS)
    pages = _text(Path("/proc/self/statm")).split()
    if limit != RLIM_INFINITY and pages:
        yield limit - 4096.0 * int(pages[0])


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
