"""Whatever a user gives ends in one sentence on stderr and status 2: kinds of hostile input."""

import io
import os
import struct
import sys
import warnings
import zipfile

import numpy as np
import pytest
from scipy.io import savemat

from beadwave.workflows.commands.app import main

T = np.arange(0, 1e-3, 1e-6)
V = 0.2 * np.exp(-(((T - 1e-4) / 3e-5) ** 2))
WALL = {"K": 1e7 * np.eye(2), "M": np.eye(2), "w": np.ones(2) / 2}
SIGNAL = {"t": T, "v": V[:, None], "spheres": 1, "time_unit": "s", "velocity_unit": "m/s"}

pytestmark = pytest.mark.usefixtures("own_folder")


def refused(capfd, *arguments):
    """Output of the command; it fails with status 2 and one sentence, without a warning."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(sys, "argv", ["beadwave", *arguments])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            main()
    told = capfd.readouterr()
    assert end.value.code == 2, told.err
    assert told.err.startswith("beadwave: ") and told.err.endswith(".\n"), told.err
    assert told.err.count("\n") == 1 and not told.out
    assert "Error" not in told.err and "BEADWAVE_DEBUG" not in told.err
    return told.err


SCENES = {
    "nested brackets": ("a = " + "[" * 5000, "nested too deeply"),
    "nested tables": ("a = " + "{a=" * 3000, "nested too deeply"),
    "a number of 5000 digits": ("[chain]\ncount = " + "9" * 5000, "whole number that is too long"),
    "a null byte": ("[chain]\ncount = 1\0\n", "is not TOML"),
    "a key twice": ("[chain]\ncount = 1\ncount = 2", "is not TOML"),
    "a list of tables": ("[[chain]]\ncount = 1", "must be a table"),
    "a kind that is a list": ("[wall]\nkind = [1]", "wall.kind"),
    "a table that is a date": ("chain = 2020-01-01", "must be a table"),
    "a key of 100000 letters": ('"' + "k" * 100_000 + '" = 1', "unknown key"),
    "no chain": ("[assembly]\nparts = ['block']", "has no [chain]"),
}


@pytest.mark.parametrize("kind", SCENES)
def test_a_hostile_scene_is_refused(kind, tmp_path, capfd):
    text, words = SCENES[kind]
    (tmp_path / "odd.toml").write_text(text)
    assert words in refused(capfd, "impact", "odd.toml")


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "folder", "loop", "huge", "n" * 300])
def test_what_is_no_file_of_a_scene_is_refused_and_not_waited_for(name, tmp_path, capfd):
    os.mkfifo("pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    with open("huge", "wb") as file:
        file.truncate(10**10)
    refused(capfd, "impact", name)
    refused(capfd, "scene", name, "--json")


@pytest.mark.parametrize(
    ("file", "arguments"),
    [
        ("p.step", ["look", "p.step"]),
        ("p.csv", ["hammer", "p.csv"]),
        ("p.uff", ["hammer", "p.uff"]),
        ("p.csv", ["tune", "--hammer=p.csv"]),
        ("p.npz", ["impact", "rig-1dof", "--rom=p.npz"]),
        ("p.mtx", ["impact", "rig-1dof", "--rom=p.mtx"]),
        ("p.mat", ["calibrate", "rig-1dof", "p.mat"]),
        ("p.msh", ["modes", "rig-rom", "--set=mesh={file='p.msh'}"]),
        ("p.csv", ["sweep", "rig-1dof", "--cases=p.csv"]),
        ("cases.parquet", ["sweep", "--open=."]),
        ("summary.json", ["report", "."]),
        ("summary.json", ["film", "."]),
    ],
)
def test_a_pipe_is_called_what_it_is_and_not_waited_for(file, arguments, capfd):
    os.mkfifo(file)
    said = refused(capfd, *arguments)
    assert file in said and "no ordinary file" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["accuracy", "rig-rigid", "--stage=mesh"], "has no [assembly]"),
        (["accuracy", "free-chain", "--stage=wall-modes"], "has no [wall]"),
        (["impact", "rig-1dof", "--rom=" + "n" * 300 + ".npz"], "too long"),
        (["run", "--nope"], "No such option"),
        (["run", "mine.toml"], "there is no file /"),
        (["run", "rig-rgid"], "the nearest known is 'rig-rigid'"),
        (["sweep", "rig-rigid", "--over=striker.velocity=1e308:-1e308:3"], "two finite numbers"),
        (["sweep", "rig-rigid", "--over=preload.force=1,2", "--of=arr"], "name it by --open"),
        (
            ["sweep", "rig-rigid", "--over=preload.force=1,2", "--dry-run", "--workers=99999999"],
            "99999999 processes; give 1 to",
        ),
        (["tune", "--out=tuned.png"], "must end in .toml"),
        (["tune", "--match=,"], "must name modes 1 to 4"),
        (["tune", "--match="], "the word after --match= is empty"),
        (["tune", "--match=1", "--free=,"], "is not known"),
        (["tune", "--match=1", "--free=head.ky,head.ky"], "--free head.ky is named twice"),
        (["tune", "--match=1", "--free=head.ky=0"], "head.ky=0 is not known"),
        (["tune", "--match=1", "--free=joints.bolts.kz"], "joints.bolts.kz is not known"),
        (["tune", "plate-on-bolts", "--free="], "the word after --free= is empty"),
        (["tune", "--match=1", "--set=joints.head.ky=-1"], "joints.head.ky = -1"),
        (["tune", "--match=1", "--set=joints.head.ky=nan"], "joints.head.ky = nan"),
        (["run", "rig-1dof", "--out", ""], "after --out is empty"),
        (["impact", "rig-1dof", "--out=", "--quiet"], "after --out= is empty"),
        (["impact", ""], "after impact is empty"),
        (["calibrate", "rig-1dof", "no.csv", "--starts=-1"], "--starts -1 must be between 1 and"),
        (["calibrate", "rig-1dof", "no.csv", "--seed=" + "9" * 400], "--seed a number of more"),
        (["twin", "--runs=2"], "twin is no command any more: python examples/twin.py"),
        (["study"], "study is no command any more: the scripts in examples/gallery"),
    ],
)
def test_a_command_says_what_it_lacks(arguments, words, capfd):
    assert words in refused(capfd, *arguments)


def header(shape):
    """A .npy of this shape that ends after its header."""
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def archive(shape):
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as file:
        for name in WALL:
            file.writestr(f"{name}.npy", header(shape))
    return held.getvalue()


WALLS = {
    "notes nested too deeply": {"provenance": "[" * 100_000},
    "notes that are cut off": {"provenance": '{"a"'},
    "notes of a number too long": {"provenance": '{"mass_kg": ' + "9" * 5000 + "}"},
    "two numbers for one": {"provenance": '{"half_space_compliance_m_per_N": "1 2"}'},
    "a list for a number": {"provenance": '{"half_space_compliance_m_per_N": []}'},
    "a complex mass": {"mass_kg": 1 + 2j},
    "an infinite count": {"n_boundary": np.inf},
    "K beyond products": {"K": np.diag([1e308, 1e307])},
    "M beyond products": {"M": np.diag([1e308, 1e307])},
    "C beyond products": {"C": np.diag([1e308, 1e307])},
    "w beyond products": {"w": 1e308 * np.ones(2)},
    "K of no number": {"K": np.nan * np.diag([1.0, 2.0])},
}


@pytest.mark.parametrize("kind", WALLS)
def test_a_hostile_wall_is_refused(kind, capfd):
    with np.errstate(all="ignore"):
        np.savez("odd.npz", **WALL | WALLS[kind])
    assert "odd.npz" in refused(capfd, "impact", "rig-1dof", "--rom=odd.npz")


@pytest.mark.parametrize("shape", ["(1000000, 1000000)", "(10**30,)", "(-1, 5)"])
def test_an_archive_that_promises_too_much_is_refused(shape, tmp_path, capfd):
    (tmp_path / "odd.npz").write_bytes(archive(shape))
    refused(capfd, "impact", "rig-1dof", "--rom=odd.npz")


def test_a_note_of_any_type_is_read(capfd):
    """Another program writes plain numbers where notes of ours were text."""
    from beadwave.workflows.files.wall_file import loaded
    from beadwave.workflows.scene import RomWall

    np.savez("plain.npz", **WALL, provenance='{"maker": 3, "mass_kg": 2.5}')
    reduced = loaded(RomWall(kind="rom", file="plain.npz"))
    assert reduced.notes == {"maker": "3", "mass_kg": "2.5"} and reduced.mass.mass == 2.5


@pytest.mark.parametrize("spheres", [np.inf, np.nan, -1, 0, 1e30, "a"])
def test_a_mat_of_no_sphere_is_refused(spheres, capfd):
    savemat("odd.mat", SIGNAL | {"spheres": spheres})
    refused(capfd, "calibrate", "rig-1dof", "odd.mat", "--set=chain.count=4")


HAMMER = {
    "cut.uff": "    -1\n    58\n",
    "words.uff": "    -1\n    58\n" + "a\n" * 30 + "    -1\n",
    "empty.uff": "",
    "huge.csv": "f,re,im\n" + "".join(f"{i},1e308,1e308\n" for i in range(80)),
    "none.csv": "f,re,im\n" + "".join(f"{i},nan,1\n" for i in range(80)),
    "flat.csv": "f,re,im\n" + "".join(f"{i},1,1\n" for i in range(80)),
    "null.csv": "\0" * 99,
}


@pytest.mark.parametrize("name", HAMMER)
def test_a_hostile_hammer_test_is_refused(name, tmp_path, capfd):
    (tmp_path / name).write_text(HAMMER[name])
    assert name in refused(capfd, "hammer", name)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"scene": 1}', "[" * 100_000])
def test_a_report_of_no_summary_is_refused(text, tmp_path, capfd):
    (tmp_path / "summary.json").write_text(text)
    refused(capfd, "report", ".")
