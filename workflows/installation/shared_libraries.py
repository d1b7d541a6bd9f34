"""Shared libraries of the system that installed wheels ask for, and the Debian packages of them.

    python -P workflows/installation/shared_libraries.py

is for `install.sh` and imports nothing that pip installs: it prints the packages that are missing,
and on stderr the libraries of which no package is known here. An ELF file names the libraries that
the loader must find for it (DT_NEEDED); a few more are opened by name.
"""

from __future__ import annotations

import struct
import sys
from ctypes import CDLL
from importlib.metadata import distributions
from pathlib import Path
from typing import NamedTuple

DT_NEEDED, DT_STRTAB, DT_RPATH, DT_RUNPATH = 1, 5, 15, 29
PT_LOAD, PT_DYNAMIC = 1, 2

GMSH = "gmsh cannot start: no tetrahedra, no STEP"
PICTURES = "no pictures of the assembly and its modes"
ALL = "most of what is installed cannot start"
LIBRARIES = {  # Debian package, what one goes without
    "libGL.so.1": ("libgl1", f"{GMSH}; {PICTURES}"),
    "libGLU.so.1": ("libglu1-mesa", GMSH),
    "libOSMesa.so.8": ("libosmesa6", f"{PICTURES} without a display"),
    "libX11.so.6": ("libx11-6", GMSH),
    "libXcursor.so.1": ("libxcursor1", GMSH),
    "libXext.so.6": ("libxext6", GMSH),
    "libXfixes.so.3": ("libxfixes3", GMSH),
    "libXft.so.2": ("libxft2", GMSH),
    "libXinerama.so.1": ("libxinerama1", GMSH),
    "libXrender.so.1": ("libxrender1", GMSH),
    "libatomic.so.1": ("libatomic1", "playwright cannot start: no tests of the report page"),
    "libfontconfig.so.1": ("libfontconfig1", GMSH),
    "libgcc_s.so.1": ("libgcc-s1", ALL),
    "libgomp.so.1": ("libgomp1", GMSH),
    "libgomp.so.1.0.0": ("libgomp1", "numba cannot start its threads"),
    "libstdc++.so.6": ("libstdc++6", ALL),
    "libz.so.1": ("zlib1g", ALL),
}
OPENED = ("libGL.so.1", "libOSMesa.so.8")  # by name, by VTK
UNUSED = (  # by parts that their programs do without
    "libtbb.so.12",  # numba: threads by TBB, one of three ways
    # mpich: networks of clusters
    "libefa.so.1", "libibverbs.so.1", "libmlx5.so.1", "libpsm2.so.2", "librdmacm.so.1",
    # Intel's wheels below pypardiso: tools of its compilers, and GPUs
    "libimf.so", "libintlc.so.5", "libirng.so", "libsvml.so", "libsycl.so.9",
)  # fmt: skip


class Linked(NamedTuple):
    """What an ELF file asks of the loader."""

    needed: tuple[str, ...]
    folders: tuple[str, ...]  # of its rpath, where the loader looks first


def linked(path: Path) -> Linked | None:
    """Dynamic section of an ELF file of 64 bits in this machine's byte order.

    None for any other file; struct.error for one that is cut or damaged.
    """
    order, mark = ("<", b"\x01") if sys.byteorder == "little" else (">", b"\x02")
    with path.open("rb") as file:
        if file.read(6) != b"\x7fELF\x02" + mark:
            return None

        def at(offset: int, form: str, n: int = 1) -> list[tuple]:
            file.seek(offset)
            return [*struct.iter_unpack(order + form, file.read(n * struct.calcsize(order + form)))]

        def text(offset: int) -> str:
            file.seek(offset)
            return file.read(4096).partition(b"\0")[0].decode(errors="replace")

        (header,) = at(0, "16s2HI3QI6H")
        # type, flags, offset, address, physical address, bytes in the file, in memory, alignment
        segments = at(header[5], "2I6Q", header[10])
        dynamic = [at(s[2], "2Q", s[5] // 16) for s in segments if s[0] == PT_DYNAMIC]
        entries = [entry for table in dynamic for entry in table]
        # the place of the names is an address in memory, whose segment says where in the file
        names = [value - s[3] + s[2] for tag, value in entries if tag == DT_STRTAB
                 for s in segments if s[0] == PT_LOAD and s[3] <= value < s[3] + s[5]]  # fmt: skip
        needed = [text(names[0] + value) for tag, value in entries if tag == DT_NEEDED and names]
        paths = [text(names[0] + value) for tag, value in entries
                 if tag in (DT_RPATH, DT_RUNPATH) and names]  # fmt: skip
    origin = str(path.parent)
    folders = (folder for line in paths for folder in line.split(":") if folder)
    absolute = (f.replace("${ORIGIN}", origin).replace("$ORIGIN", origin) for f in folders)
    return Linked(tuple(needed), tuple(absolute))


def missing_libraries(folders: list[str] | None = None) -> list[tuple[str, str | None, str]]:
    """What the loader does not find of what wheels ask for: its name, Debian's package, None where
    it is not known here, and what its absence costs. Without folders, those of sys.path."""
    files = {
        wheel.metadata["Name"]: [Path(wheel.locate_file(file)) for file in wheel.files or ()]
        for wheel in distributions(**({} if folders is None else {"path": folders}))
    }
    in_wheels = {path.name for paths in files.values() for path in paths}
    users = dict.fromkeys(OPENED, "pyvista")
    for wheel, paths in files.items():
        for path in paths:
            # programs have no ending; Python's files by the thousand are not opened
            if (".so" not in path.name and path.suffix) or not path.is_file():
                continue
            try:
                elf = linked(path)
            except (OSError, struct.error):
                continue
            for name in elf.needed if elf else ():
                in_rpath = any(Path(folder, name).exists() for folder in elf.folders)
                if not in_rpath and name not in in_wheels and name not in UNUSED:
                    users.setdefault(name, wheel)
    unknown = {name: (None, f"programs of {wheel} cannot start") for name, wheel in users.items()}
    return [(name, *LIBRARIES.get(name, unknown[name])) for name in users if not loads(name)]


def loads(library: str) -> bool:
    """Whether the system's loader finds it, and what it needs itself."""
    try:
        CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    for name, package, costs in missing_libraries():
        if package:
            print(package)
        else:
            hint = f"{name} is missing, {costs}; apt-file search {name} names its package"
            print(hint, file=sys.stderr)
