"""The installation: what is there, what is missing and what that rules out, where the cache is."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from os import environ
from platform import machine, python_version
from typing import NamedTuple

from pydantic import BaseModel

from beadwave.system import LINUX, adding, free_cores, free_memory
from beadwave.workflows.installation.shared_libraries import missing_libraries

MISSING = {  # distribution of an extra: extra, what one goes without
    "pypardiso": ("fast", "factorisations of large models take longer; results are the same"),
    "h5py": ("h5", "reduced models cannot be read from or written to .h5"),
    "pyuff": ("identify", "no universal files (.uff, .unv) of hammer tests, shapes and records"),
    "imageio-ffmpeg": ("film", "films are GIF, not MP4"),
    "dynesty": ("posterior", "no --posterior of calibrate and tune"),
    "pyarrow": ("sweep", "no beadwave sweep"),
    "distributed": ("sweep", "no sweep on several processes or on a cluster"),
    "h5netcdf": ("sweep", "no sweep --signals"),
    "scikit-sundae": ("peers", "no CVODE in the tables of accuracy"),
}
ARM = ("aarch64", "arm64", "armv7l")
NO_GMSH = "it has no wheel for Linux on ARM: no bodies are drawn, meshed or read from STEP"
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BEADWAVE_PROCESSES")


class Absent(NamedTuple):
    """Something that is not there, what one goes without, and how to get it."""

    name: str
    costs: str
    remedy: str


class Installation(BaseModel):
    """State of the installation; `missing` is empty if it is complete."""

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
        threads = ", ".join(f"{name} = {value}" for name, value in self.threads.items())
        lines = [
            ("Python", f"{self.python}, {self.machine}"),
            *self.installed.items(),
            ("cores", f"{self.cores}{', ' + threads if threads else ''}"),
            ("free memory", "unknown" if free is None else f"{free / 1e9:.1f} GB"),
            ("results kept in", f"{self.cache}, {self.cache_bytes / 1e6:.0f} MB"),
            ("", f"not used, it {self.cache_fault}" if self.cache_fault else "in use"),
        ]
        rows = [f"{name:>16}  {value}" for name, value in lines]
        missing = [f"missing: {name}: {costs}; {remedy} adds it." for name, costs, remedy in
                   self.missing]  # fmt: skip
        return "\n".join([*rows, "", *(missing or ["Nothing is missing."])])

    def __repr__(self) -> str:
        return self.text()


def doctor() -> Installation:
    """Installed and missing packages, and what the missing ones cost (`beadwave doctor`)."""
    from beadwave.fem.modes.solver.factorisation import has_pardiso
    from beadwave.workflows.files.cache_folder import cache_folder
    from beadwave.workflows.stages.engine.cache import LIBRARIES as NEEDED
    from beadwave.workflows.stages.engine.cache import fault, library_versions

    # extras that are not installed, libraries that the loader does not find
    missing = []
    for name, (extra, costs) in MISSING.items():
        try:
            version(name)
        except PackageNotFoundError:
            missing.append(Absent(name, costs, adding(extra)))
    if "pypardiso" not in (absent.name for absent in missing) and not has_pardiso():
        costs = "pypardiso finds no library mkl_rt, and " + MISSING["pypardiso"][1]
        missing.append(Absent("mkl", costs, "pip install --force-reinstall mkl"))
    if LINUX and machine() in ARM and not library_versions(("gmsh",)):
        missing.append(Absent("gmsh", NO_GMSH, "building it of its sources with Python"))
    for name, package, costs in missing_libraries() if LINUX else ():
        missing.append(Absent(name, costs, f"apt-get install {package}"))

    names = ("beadwave", *NEEDED, "matplotlib", "pyvista", "xarray", *MISSING)
    folder, free = cache_folder(), free_memory()
    files = (file for file in folder.rglob("*") if file.is_file())
    return Installation(
        python=python_version(),
        machine=machine(),
        installed=library_versions(names),
        missing=missing,
        cache=str(folder),
        cache_bytes=sum(file.stat().st_size for file in files),
        cache_fault=fault(),
        cores=free_cores(),
        threads={name: environ[name] for name in THREADS if name in environ},
        memory_free_bytes=int(free) if isfinite(free) else None,
    )
