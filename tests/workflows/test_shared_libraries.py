"""Shared libraries that the programs of wheels ask for, and the Debian packages that hold them."""

import runpy
import struct
import sys
from ctypes import CDLL

import numpy as np
import pytest

from beadwave.workflows.installation import doctor, shared_libraries
from beadwave.workflows.installation.shared_libraries import Linked, linked, missing_libraries

AT = 0x10000  # address at which the file lies in memory


def elf(needed=(), runpath=None):
    """An ELF file of one segment: headers, dynamic section, names."""
    names, entries = b"\0", []
    for tag, text in [*((1, name) for name in needed), *([(29, runpath)] if runpath else [])]:
        entries.append((tag, len(names)))
        names += text.encode() + b"\0"
    start = 64 + 2 * 56  # of the dynamic section, behind the header and those of two segments
    size = 16 * (len(entries) + 2)
    entries += [(5, AT + start + size), (0, 0)]
    whole = start + size + len(names)
    ident = b"\x7fELF\x02" + (b"\x01" if sys.byteorder == "little" else b"\x02")
    return (
        struct.pack("=16s2HI3QI6H", ident, 3, 62, 1, 0, 64, 0, 0, 64, 56, 2, 0, 0, 0)
        + struct.pack("=2I6Q", 1, 5, 0, AT, AT, whole, whole, 4096)
        + struct.pack("=2I6Q", 2, 5, start, AT + start, AT + start, size, size, 8)
        + b"".join(struct.pack("=2Q", *entry) for entry in entries)
        + names
    )


def wheel(folder, name, files):
    """What pip leaves of a wheel with these files."""
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    for place, content in files.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_bytes(content)
    (about / "RECORD").write_text("".join(f"{place},,\n" for place in files))


@pytest.fixture
def absent(monkeypatch):
    """The loader finds every library but those in this set."""
    names = set()

    def load(name, *_):
        if name in names:
            raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(shared_libraries, "CDLL", load)
    return names


def test_the_names_in_an_elf_file_are_those_that_the_loader_looks_for(tmp_path):
    (tmp_path / "node").write_bytes(elf(["libatomic.so.1", "libc.so.6"], "$ORIGIN/../lib:/opt"))
    found = linked(tmp_path / "node")
    assert found == Linked(("libatomic.so.1", "libc.so.6"), (f"{tmp_path}/../lib", "/opt"))
    (tmp_path / "static").write_bytes(elf())
    assert linked(tmp_path / "static") == Linked((), ())
    (tmp_path / "script").write_text("#!/bin/sh\n")
    assert linked(tmp_path / "script") is None
    compiled = sys.modules[np.linalg._umath_linalg.__name__].__file__  # a real one
    assert "libc.so.6" in linked(shared_libraries.Path(compiled)).needed


def test_a_library_that_a_program_of_a_wheel_asks_for_is_missing_with_its_package(tmp_path, absent):
    absent |= {"libatomic.so.1", "libshelf.so.3"}
    wheel(tmp_path, "player", {"player/driver/node": elf(["libatomic.so.1", "libc.so.6"])})
    wheel(tmp_path, "carpenter", {"carpenter/saw.abi3.so": elf(["libshelf.so.3"])})
    wheel(tmp_path, "words", {"words/README": b"no program", "words/cut": elf(["libcut.so"])[:90]})
    found = {name: (package, costs) for name, package, costs in missing_libraries([tmp_path])}
    assert found.keys() == absent
    assert found["libatomic.so.1"][0] == "libatomic1"
    assert found["libshelf.so.3"] == (None, "programs of carpenter cannot start")


@pytest.mark.parametrize("where", ["run path", "same wheel", "another wheel"])
def test_a_library_that_a_wheel_brings_is_not_missing(where, tmp_path, absent):
    absent.add("libshelf.so.3")
    path = "$ORIGIN/../carpenter.libs" if where == "run path" else None
    program = {"carpenter/saw": elf(["libshelf.so.3"], path)}
    library = {"carpenter.libs/libshelf.so.3": elf()}
    if where == "run path":
        wheel(tmp_path, "carpenter", program)
        (tmp_path / "carpenter.libs").mkdir()
        (tmp_path / "carpenter.libs" / "libshelf.so.3").write_bytes(elf())
    elif where == "same wheel":
        wheel(tmp_path, "carpenter", program | library)
    else:
        wheel(tmp_path, "carpenter", program)
        wheel(tmp_path, "shelf", library)
    assert missing_libraries([tmp_path]) == []


def test_a_part_that_its_program_does_without_is_not_missing(tmp_path, absent):
    absent |= {"libibverbs.so.1", "libtbb.so.12"}
    wheel(tmp_path, "mpich", {"lib/libmpi.so.12": elf(["libibverbs.so.1", "libtbb.so.12"])})
    assert missing_libraries([tmp_path]) == []


def test_libraries_that_are_opened_by_name_are_missing_without_any_wheel(tmp_path, absent):
    absent.add("libOSMesa.so.8")
    ((name, package, costs),) = missing_libraries([tmp_path])
    assert (name, package) == ("libOSMesa.so.8", "libosmesa6") and "pictures" in costs


def test_every_library_that_is_opened_by_name_has_its_package():
    assert set(shared_libraries.OPENED) <= shared_libraries.LIBRARIES.keys()


@pytest.mark.slow
def test_doctor_names_the_package_or_the_search_for_it(tmp_path, absent, monkeypatch):
    absent |= {"libatomic.so.1", "libshelf.so.3"}
    wheel(tmp_path, "player", {"player/node": elf(["libatomic.so.1", "libshelf.so.3"])})
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    remedies = {one.name: one.remedy for one in doctor.doctor().missing}
    assert remedies["libatomic.so.1"] == "apt-get install libatomic1"
    assert remedies["libshelf.so.3"] == "the package that apt-file search libshelf.so.3 names"


def test_the_installer_is_told_packages_alone(tmp_path, monkeypatch, capsys):
    """As a program of its own, which imports nothing of ours."""

    def load(name, *of, **more):
        if name in ("libatomic.so.1", "libshelf.so.3"):
            raise OSError(name)
        return CDLL(name, *of, **more)

    wheel(tmp_path, "player", {"player/node": elf(["libshelf.so.3", "libatomic.so.1"])})
    monkeypatch.setattr("ctypes.CDLL", load)
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    runpy.run_path(shared_libraries.__file__, run_name="__main__")
    told = capsys.readouterr()
    assert "libatomic1" in told.out.splitlines()
    assert "libshelf" not in told.out
    assert "libshelf.so.3 is missing" in told.err and "apt-file search libshelf.so.3" in told.err
