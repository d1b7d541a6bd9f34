"""Scans: every point as its single run, mirrored points alike, points beside the face told."""

import signal
import subprocess
import sys
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from skfem import MeshHex
from skfem.io.meshio import HEX_MAPPING

import beadwave
import rom
from beadwave import InvalidScene
from workflows.pipeline import face
from workflows.pipeline.face import Outline
from workflows.sweep import scan
from workflows.sweep.scan import Grid, grid

BLOCK = {
    "name": "block",
    "chain": {"count": 6, "radius": 0.005, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.2},
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.002},
    "time": {"duration": 4e-4},
    "output": {"spheres": [1, 5], "samples": 401},
    "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
    "strike": {"on": "block:+z", "radius": 2e-3},
    "assembly": {"held": ["block:-z"], "material": "steel"},
    "bodies": {"block": {"box": [0.06, 0.04, 0.02], "seed": 0.01}},
}
DRILLED = {
    "outline": [[-0.03, -0.02], [0.03, -0.02], [0.03, 0.02], [-0.03, 0.02]],
    "thickness": 0.02,
}


@pytest.fixture(autouse=True)
def here(shared_cache):
    pass


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    out = tmp_path_factory.mktemp("scan") / "out"
    return beadwave.scan(BLOCK, grid="5x4", out=out, signals=True)


def test_a_point_is_its_single_run_within_the_errors_stated(scanned):
    v = scanned.signals()["v"].to_numpy()
    for case in (0, 7, 13):
        at = [scanned.columns[axis][case].item() for axis in ("x", "y")]
        alone = beadwave.impact(BLOCK, {"strike.at": at})
        own = alone.summary.error_estimate
        stated = sum(scanned.columns[f"error_{of}"][case] for of in ("time", "reduction", "mesh"))
        allowed = stated + own.time + own.reduction + own.mesh
        off = np.abs(v[case] - alone.arrays["v"][:, [0, 4]]).max() / 0.2
        assert 0.0 < off < allowed < 0.02
        assert scanned.columns["error_reduction"][case] < 1e-3
        force = scanned.columns["wall_peak_force_N"][case]
        assert abs(force / alone.summary.peak_wall_force_N - 1.0) < 5 * allowed


def test_mirrored_points_are_equal(scanned):
    for name in ("sphere_5_arr", "sphere_5_tof_s", "wall_peak_force_N"):
        found = scanned.columns[name].reshape(5, 4)
        assert np.abs(found / found[::-1] - 1.0).max() < 1e-8
        assert np.abs(found / found[:, ::-1] - 1.0).max() < 1e-8
        assert np.ptp(found) > 1e-5 * np.abs(found).max()


def test_the_map_shows_the_face(scanned):
    assert {p.name for p in scanned.folder.glob("figures/*")} >= {"sphere_5_arr.png"}
    edges = np.array(scanned.face["edges"])
    assert scanned.face["name"] == "block:+z" and scanned.face["axes"] == ["x", "y"]
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum()
    assert abs(length / (2 * (0.06 + 0.04)) - 1.0) < 1e-9
    again = beadwave.load_sweep(scanned.folder)
    assert again.plot("wall_peak_s").png.startswith(b"\x89PNG")


def test_points_in_a_hole_are_rows_that_say_so(tmp_path):
    plate = {"plate": DRILLED, "holes": {"diameter": 0.012, "at": [[0.0, 0.0]]}, "seed": 0.01}
    scene = BLOCK | {"bodies": {"block": plate}}
    found = beadwave.scan(scene, grid="3x3", out=tmp_path / "out")
    assert found.counts() == {"done": 8, "refused": 1}
    assert found.columns["status"][4] == "refused"
    assert "leaves the face" in found.columns["message"][4]
    assert np.isnan(found.columns["wall_peak_force_N"][4])
    assert len(found.plot("sphere_5_arr").png) > 1000


def test_a_scan_that_is_there_is_kept(scanned, monkeypatch):
    told = []
    beadwave.scan(BLOCK, grid="5x4", out=scanned.folder, signals=True)  # keeps the outline
    monkeypatch.setattr(face.stages, "model", None)  # costs no assembly
    again = beadwave.scan(
        BLOCK, grid="5x4", out=scanned.folder, signals=True, told=lambda *n: told.append(n)
    )
    assert told == [(20, 20)]
    assert np.array_equal(again.columns["seconds"], scanned.columns["seconds"])


def meshed(path, thickness):
    """A block of hexahedra with a name, in a file."""
    ends = ((-0.03, 0.03, 4), (-0.02, 0.02, 3), (0.0, thickness, 2))
    block = MeshHex.init_tensor(*(np.linspace(*along) for along in ends))
    cells = [("hexahedron", block.t[HEX_MAPPING[:8]].T)]
    sets = {"block": [np.arange(block.nelements)]}
    meshio.Mesh(block.p.T, cells, cell_sets=sets).write(path)


def test_a_scan_is_computed_anew_once_its_mesh_is_another(tmp_path, monkeypatch):
    monkeypatch.setattr(scan, "PART", 1)
    monkeypatch.setattr("workflows.api.sweeps._draw", lambda *_: None)
    marched, table = [], scan._table
    monkeypatch.setattr(scan, "_table", lambda *args: marched.extend(args[1]) or table(*args))
    assembly = {"mesh": str(tmp_path / "block.inp"), "held": ["block:-x"], "material": "steel"}
    scene = {key: table for key, table in BLOCK.items() if key != "bodies"}

    def scanned(told=lambda *_: None):
        marched.clear()
        scene["assembly"] = assembly
        return beadwave.scan(scene, grid="2x1", out=tmp_path / "out", told=told)

    def stop(done, n):
        if done == 1:
            raise KeyboardInterrupt

    meshed(tmp_path / "block.inp", 0.02)
    old = scanned()
    assert scanned().notes == () and not marched
    meshed(tmp_path / "block.inp", 0.006)
    with pytest.raises(KeyboardInterrupt):
        scanned(stop)
    assert marched == [0] and list(tmp_path.glob("out/part-*"))
    meshed(tmp_path / "block.inp", 0.004)
    found = scanned()
    assert marched == [0, 1] and "a file that it was made of changed" in found.notes[0]
    change = found.columns["wall_peak_force_N"] / old.columns["wall_peak_force_N"] - 1.0
    assert np.abs(change).max() > 0.1 and not list(tmp_path.glob("out/part-*"))


KILLED = """
import beadwave, os, signal
from workflows.sweep import scan
scan.PART = 6
def told(done, n):
    if done >= 12:
        os.kill(os.getpid(), signal.SIGKILL)
beadwave.scan({scene}, grid="5x4", out={out!r}, signals=True, told=told)
"""


def test_a_killed_scan_goes_on_with_the_points_that_are_missing(tmp_path, scanned, monkeypatch):
    out, marched = tmp_path / "out", []
    script = KILLED.format(scene=BLOCK, out=str(out))
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, timeout=600, capture_output=True, start_new_session=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    parts = {path.name for path in out.glob("part-*.parquet")}
    assert len(parts) == 2 and not list(out.glob("cases.parquet"))
    table = scan._table
    monkeypatch.setattr(scan, "_table", lambda *args: marched.extend(args[1]) or table(*args))
    solved, reduced, own, modes = [], [], rom.Face, face.modes
    monkeypatch.setattr(rom, "Face", lambda *of: reduced.append(of[2].shape[1]) or own(*of))
    monkeypatch.setattr(face, "modes", lambda *of: solved.append(of) or modes(*of))
    monkeypatch.setattr(scan, "COMPARED", 4)
    told = []
    found = beadwave.scan(
        BLOCK, grid="5x4", out=out, signals=True, told=lambda *n: told.append(n)
    )  # fmt: skip
    assert told[0] == (12, 20) and told[-1] == (20, 20) and marched == list(range(12, 20))
    assert found.counts() == {"done": 20} and not list(out.glob("part-*"))
    assert len(solved) == 1  # modes of the second mesh alone
    assert reduced[0] == 8 + 2 and reduced[1:] in (
        [4],
        [1, 4],
    )  # of those compared 0 and 6 are done
    fewer = found.columns["error_mesh"] / scanned.columns["error_mesh"]  # points compared
    assert ((0.01 < fewer) & (fewer < 1.05)).all()
    for name in ("sphere_5_tof_s", "wall_peak_force_N", "error_reduction"):
        allowed = 0.05 if name.startswith("error") else scanned.columns["error_time"][0]
        assert np.abs(found.columns[name] / scanned.columns[name] - 1.0).max() < allowed
    v, whole = (one.signals()["v"].to_numpy() for one in (found, scanned))
    assert np.abs(v - whole).max() < 0.2 * scanned.columns["error_time"][0]


def test_points_are_mirrored_to_the_last_digit():
    ends = np.array([[-0.05, -0.02], [0.05, 0.02]])
    struck = SimpleNamespace(
        patch=SimpleNamespace(radius=0.002), outline=lambda: Outline(("y", "z"), *ends, None)
    )
    found = Grid(7, 4).design(struck)
    y, z = (np.array(values).reshape(7, 4) for values in found.columns.values())
    assert np.array_equal(y, -y[::-1]) and np.array_equal(z, -z[:, ::-1])
    assert y.max() == pytest.approx(0.048) and z.max() == pytest.approx(0.018)


@pytest.mark.parametrize(
    ("scene", "changes", "options", "says"),
    [
        ("rig-rigid", {}, {}, "a scan moves the chain over an assembly"),
        (BLOCK, {}, {"grid": "20"}, "two whole numbers"),
        (BLOCK, {}, {"grid": "0x4"}, "two whole numbers"),
        (BLOCK, {}, {"grid": "6" * 4500 + "x2"}, "two whole numbers from 1 to 10000"),
        (BLOCK, {}, {"grid": "200x200"}, "allowed are 10000"),
        (BLOCK, {}, {"face": "block:+w"}, "block"),
        (BLOCK, {}, {"face": "lid:+x"}, "names no body"),
        (BLOCK, {"strike.radius": 0.03}, {}, "take a smaller patch"),
        (BLOCK, {"time.horizon": 1e-4}, {}, "goes beyond time.horizon"),
        ("rig-rom", {}, {"face": "block:+y"}, "the rig is struck on"),
        ("rig-rom", {"patch.weights": "thesis"}, {}, "bound to nodes"),
        ("rig-rom", {"joints.head.cx": 10.0, "joints.head.kx": 1e7}, {}, "dashpots"),
    ],
)
def test_scans_that_cannot_be_are_refused(tmp_path, scene, changes, options, says):
    with pytest.raises(InvalidScene, match=says):
        beadwave.scan(scene, changes, out=tmp_path / "out", **options)


def test_a_round_face_is_refused(tmp_path):
    bodies = {"block": {"cylinder": {"radius": 0.03, "length": 0.05}, "seed": 0.015}}
    scene = BLOCK | {"bodies": bodies, "strike": {"on": "block:cylinder", "at": [0.03, 0.0, 0.0]}}
    with pytest.raises(InvalidScene, match="plane"):
        beadwave.scan(scene, out=tmp_path / "out")


def test_a_grid_is_read():
    assert grid("20x10") == (20, 10) and grid("3X4") == (3, 4)
