"""Shared libraries that the programs of wheels ask for, and the Debian packages that hold them."""

import runpy
import subprocess
from pathlib import Path
from shutil import which

import gmsh
import pytest

from beadwave.workflows.installation import doctor, shared_libraries
from beadwave.workflows.installation.shared_libraries import LIBRARIES, missing_libraries


def load(absent):
    """A loader that finds every library but these."""

    def opened(name, *_):
        if name in absent:
            raise OSError(f"{name}: cannot open shared object file")

    return opened


def test_a_library_that_the_loader_does_not_find_is_named_with_its_package(monkeypatch, capsys):
    monkeypatch.setattr(shared_libraries, "CDLL", load({"libGLU.so.1", "libz.so.1"}))
    assert [line[:2] for line in missing_libraries()] == [
        ("libGLU.so.1", "libglu1-mesa"), ("libz.so.1", "zlib1g"),
    ]  # fmt: skip
    missing = {name: (costs, remedy) for name, costs, remedy in doctor.doctor().missing}
    if doctor.LINUX:
        costs, remedy = missing["libGLU.so.1"]
        assert "gmsh cannot start" in costs and remedy == "apt-get install libglu1-mesa"
    monkeypatch.setattr("ctypes.CDLL", load({"libXft.so.2"}))
    runpy.run_path(shared_libraries.__file__, run_name="__main__")
    assert capsys.readouterr().out == "libxft2\n"


@pytest.mark.skipif(not which("objdump"), reason="needs objdump (of the package binutils)")
def test_what_gmsh_is_linked_to_is_in_the_table():
    """Its wheel asks for more libraries of the system than all others together."""
    library = next(Path(gmsh.__file__).parent.rglob("libgmsh.so*"), None) or gmsh.libpath
    direct = subprocess.run(["objdump", "-p", library], capture_output=True, text=True, check=True)
    needed = {line.split()[1] for line in direct.stdout.splitlines() if "NEEDED" in line}
    of_libc = {"libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "librt.so.1"}
    loader = {name for name in needed if name.startswith("ld-linux")}
    assert needed - of_libc - loader and needed - of_libc - loader <= LIBRARIES.keys()
