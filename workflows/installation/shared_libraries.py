"""Shared libraries of the system that the wheels of our dependencies load, and their Debian
packages.

    python -P workflows/installation/shared_libraries.py

is for `install.sh` and imports nothing that pip installs: it prints the packages that are missing.
"""

from ctypes import CDLL

GMSH = "gmsh cannot start: no tetrahedra, no STEP"
PICTURES = "no pictures of the assembly and its modes"
ALL = "most of what is installed cannot start"
LIBRARIES = {  # Debian package, the loss without it
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
    "libfontconfig.so.1": ("libfontconfig1", GMSH),
    "libgcc_s.so.1": ("libgcc-s1", ALL),
    "libgomp.so.1": ("libgomp1", f"numba cannot start its threads; {GMSH}"),
    "libstdc++.so.6": ("libstdc++6", ALL),
    "libz.so.1": ("zlib1g", ALL),
}


def missing_libraries() -> list[tuple[str, str, str]]:
    """Libraries that the loader does not find: name, Debian package, the loss without it."""
    return [(name, *about) for name, about in LIBRARIES.items() if not loads(name)]


def loads(library: str) -> bool:
    """True if the system's loader finds it, and what it needs itself."""
    try:
        CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    for _, package, _ in missing_libraries():
        print(package)
