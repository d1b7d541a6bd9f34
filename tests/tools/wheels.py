"""A table of the default dependencies, by system and Python: the version whose wheel pip takes.

    python tests/tools/wheels.py                 every system and Python, some minutes
    python tests/tools/wheels.py win_amd64 3.13  some of them

Nothing is installed. pip resolves by tags of another system but reads the conditions of
dependencies (`platform_system == "Windows"`) for the system that it runs on: those of the other
system are added here, and what only this system needs stays in the table. Status 1 where a wheel is
missing.
"""

import json
import sys
import tomllib
from itertools import product
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
LINUX = ("2_28", "2_27", "2_26", "2_24", "2_17", "2_12", "2_5")
SYSTEMS = {  # tags that pip is given, words of the conditions
    "win_amd64": (["win_amd64"], {"sys_platform": "win32", "platform_system": "Windows",
                                  "os_name": "nt", "platform_machine": "AMD64"}),
    "macosx_arm64": (["macosx_14_0_arm64"], {"sys_platform": "darwin", "platform_system": "Darwin",
                                             "os_name": "posix", "platform_machine": "arm64"}),
    "linux_x86_64": ([f"manylinux_{v}_x86_64" for v in LINUX] + ["manylinux2014_x86_64"],
                     {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix",
                      "platform_machine": "x86_64"}),
}  # fmt: skip


def resolved(requirements: list[str], tags: list[str], python: str) -> list[dict] | str:
    """Metadata of the wheels that pip would install, or the last line of what it says instead."""
    with TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        command = [
            sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet",
            "--disable-pip-version-check", "--only-binary=:all:", "--implementation=cp",
            f"--python-version={python}", f"--target={folder}", f"--report={report}",
            *(f"--platform={tag}" for tag in tags), *requirements,
        ]  # fmt: skip
        done = run(command, capture_output=True, text=True, encoding="utf-8", check=False)
        if done.returncode:
            return done.stderr.strip().splitlines()[-1]
        return [row["metadata"] for row in json.loads(report.read_text("utf-8"))["install"]]


def versions(wanted: list[str], system: str, python: str) -> dict[str, str]:
    """Version of each package of the closure by its name; "none" where no wheel is found."""
    tags, words = SYSTEMS[system]
    environment = words | {"python_version": python, "python_full_version": f"{python}.0"}
    asked, missing = list(wanted), {}
    while True:
        found = resolved(asked, tags, python)
        if isinstance(found, str):
            alone = {name: resolved([name], tags, python) for name in asked}
            failing = {name: why for name, why in alone.items() if isinstance(why, str)}
            if not failing:
                raise SystemExit(f"{system} {python}: {found}")
            print("\n".join(f"{system} {python} {n}: {why}" for n, why in failing.items()))
            missing |= dict.fromkeys(failing, "none")
            asked = [name for name in asked if name not in failing]
            continue
        held = {canonicalize_name(row["name"]): row["version"] for row in found}
        further = [
            need for row in found for need in map(Requirement, row.get("requires_dist", ()))
            if canonicalize_name(need.name) not in held.keys() | missing.keys()
            and (need.marker is None or need.marker.evaluate(environment | {"extra": ""}))
        ]  # fmt: skip
        if not further:
            return held | missing
        asked += sorted({need.name for need in further})


def main(arguments: list[str]) -> int:
    """Print the table; 1 where a wheel is missing."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    systems = [word for word in arguments if word in SYSTEMS] or list(SYSTEMS)
    pythons = [word for word in arguments if word in PYTHONS] or list(PYTHONS)
    columns = list(product(systems, pythons))
    cells = {column: versions(project["dependencies"], *column) for column in columns}
    names = sorted({name for column in cells.values() for name in column})
    rows = [["", *(f"{system} {python}" for system, python in columns)]]
    rows += [[name, *(cells[column].get(name, "-") for column in columns)] for name in names]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip())
    return int(any("none" in column.values() for column in cells.values()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
