"""Scans: every point as its single run, mirrored points alike, points beside the face told."""

import signal
import subprocess
import sys
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import tomli_w
from skfem import MeshHex
from skfem.io.meshio import HEX_MAPPING

import beadwave
from beadwave import InvalidScene, dem, rom
from beadwave.coupling import ModalDamping
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.rom.contact_modes import finer_space
from beadwave.rom.reduced_model import of_modes
from beadwave.workflows.stages.structure import face
from beadwave.workflows.stages.structure.face import Outline
from beadwave.workflows.sweep import result, scan
from beadwave.workflows.sweep.cases import base_of
from beadwave.workflows.sweep.scan import Grid, grid

from command_line import beadwave as command

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


@pytest.mark.slow
def test_a_point_is_its_single_run_within_the_errors_stated(scanned):
    v = scanned.signals()["v"].to_numpy()
    for case in (0, 7, 13):
        at = [scanned.columns[axis][case].item() for axis in ("x", "y")]
        alone = beadwave.impact(BLOCK, {"strike.at": at})
        own = alone.summary.error_estimate
        stated = sum(scanned.columns[f"error_{of}"][case] for of in ("time", "reduction", "mesh"))
        allowed = stated + own.time + own.reduction + own.mesh
        off = np.abs(v[case] - alone.arrays["v"][:, [0, 4]]).max() / 0.2
        assert 0.0 < off < allowed < 0.03
        assert scanned.columns["error_reduction"][case] < 1e-3
        force = scanned.columns["wall_peak_force_N"][case]
        assert abs(force / alone.summary.peak_wall_force_N - 1.0) < 5 * allowed


PLATE = BLOCK | {
    "name": "thin-plate",
    "chain": BLOCK["chain"] | {"count": 8, "radius": 0.003},
    "striker": {"velocity": 0.3},
    "damping": {"kind": "modal", "ratio": 0.005},
    "time": {"duration": 2.5e-4},
    "output": {"spheres": [2, 6], "samples": 501},
    "strike": {"on": "plate:+z", "radius": 1e-3},
    "assembly": {"held": ["plate:-x"], "material": "steel"},
    "bodies": {"plate": {"box": [0.08, 0.06, 0.003], "seed": 0.006}},
}


@pytest.fixture(scope="module")
def thin(tmp_path_factory):
    out = tmp_path_factory.mktemp("scan") / "out"
    return beadwave.scan(PLATE, grid="4x2", out=out, signals=True)


@pytest.mark.slow
def test_each_point_states_its_own_error_of_the_reduction(thin):
    """True is the difference to a model of the point alone that holds all moments up to 20 kHz."""
    struck = face.StruckFace(scan.struck_scene(base_of(PLATE, ()), None))
    begun, (problem, modes) = struck.begun, struck._basis
    v, stated = thin.signals()["v"].to_numpy(), thin.columns["error_reduction"]
    assert stated.max() > 3 * stated.min() > 0
    for case in (0, 2, 4, 6):
        at = [thin.columns[axis][case].item() for axis in ("x", "y")]
        (patch,) = struck.placed(np.array([at]))[0].values()
        pairs = finer_space(problem, patch.w, modes, 20e3).pairs
        half_space = float(struck.walls([patch], 1).half_space[0])
        wall = wall_from_reduced(
            of_modes(*pairs, None, patch.w, None),
            half_space=half_space,
            damping=ModalDamping(0.005),
        )
        dt = thin.columns["dt_s"][case] / 8
        run = dem.march(
            begun.chain, wall, begun.velocity, duration=PLATE["time"]["duration"], dt=dt, n_save=500
        )
        true = np.abs(run.v[:, [1, 5]] - v[case]).max() / 0.3
        assert true / 3 < stated[case] < 3 * true
        alone = beadwave.impact(PLATE, {"strike.at": at}).summary.error_estimate
        assert stated[case] < 3 * alone.reduction


@pytest.mark.slow
def test_each_point_states_its_own_error_of_the_mesh(thin):
    """True is the difference to a run, whose mesh is refined at the point, give or take its own."""
    v, stated = thin.signals()["v"].to_numpy(), thin.columns["error_mesh"]
    for case in (0, 2, 4, 6):
        at = [thin.columns[axis][case].item() for axis in ("x", "y")]
        alone = beadwave.impact(PLATE, {"strike.at": at})
        off, own = np.abs(v[case] - alone.arrays["v"][:, [1, 5]]).max() / 0.3, alone.summary
        own = own.error_estimate.mesh
        assert (off - own) / 3 < stated[case] < 3 * (off + own)
    assert stated.max() > 3 * stated.min() > 0


@pytest.mark.slow
def test_errors_of_the_mesh_hold_on_a_sharp_inner_edge_and_beside_a_held_one(tmp_path):
    """And beside the face that is held, where the static response beyond the modes counts. True is
    the difference to a third of the size, which is too small by the error of that one."""
    outline = [[0, 0], [0.06, 0], [0.06, 0.006], [0.006, 0.006], [0.006, 0.06], [0, 0.06]]
    v, stated = [], []
    for seed in (6e-3, 2e-3):
        angle = {"plate": {"thickness": 0.03, "outline": outline}, "seed": seed}
        changes = {"bodies": {"block": angle}, "name": f"angle-{seed:g}", "strike.on": "block:-x"}
        scene = BLOCK | {"assembly": {"held": ["block:-y"], "material": "steel"}}
        found = beadwave.scan(scene, changes, grid="3x2", out=tmp_path / f"{seed:g}", signals=True)
        v.append(found.signals()["v"].to_numpy())
        stated.append(found.columns["error_mesh"])
    true = np.abs(v[0] - v[1]).max(axis=(1, 2)) / 0.2
    ratio = stated[0] / true
    assert true.min() > 0.003 and 1 < ratio.min() and ratio.max() < 4
    assert np.all(stated[1] < stated[0] / 2)


@pytest.mark.slow
def test_large_errors_are_reported_in_the_row_and_on_the_terminal(
    thin, tmp_path, monkeypatch, capsys
):
    limit = 0.01  # the mesh's error is above it but for two points
    monkeypatch.setattr(scan, "LARGE_ERROR", limit)
    monkeypatch.setattr(result, "LARGE_ERROR", limit)
    scene = tmp_path / "plate.toml"
    scene.write_text(tomli_w.dumps(PLATE), encoding="utf-8")
    assert command("scan", scene, "--grid", "4x2", "--out", tmp_path / "out") == 0
    said = capsys.readouterr()
    worst = 100 * thin.columns["error_mesh"].max()
    assert "error of the mesh is above 1 % of the striker's speed at 6 of 8 points" in said.err
    assert f"{worst:.2g} % at the worst" in said.err
    assert "error of the reduction" not in said.err and "8 done" in said.out
    found = beadwave.load_sweep(tmp_path / "out")
    for error, message in zip(found.columns["error_mesh"], found.columns["message"], strict=True):
        assert (f"the error of the mesh is {100 * error:.2g} % of" in message) == (error > limit)
    assert found.notes and not found.messages()  # every point has a result


def test_a_point_without_a_wall_on_the_split_mesh_says_that_its_error_is_not_known(
    tmp_path, monkeypatch
):
    """A block of few elements, whose error is that to a mesh of split ones."""

    class Refusing:
        def placed(self, points):
            return {}, dict.fromkeys(range(len(points)), "its patch leaves the face.")

    monkeypatch.setattr(face.StruckFace, "split", lambda _: (Refusing(), 1.0))
    coarse = {"bodies.block.seed": 0.02, "strike.radius": 4e-3}
    result = beadwave.scan(BLOCK, coarse, grid="2x1", out=tmp_path / "out")
    assert np.isnan(result.columns["error_mesh"]).all() and result.counts() == {"done": 2}
    assert all("its patch leaves the face" in message for message in result.columns["message"])
    assert any("not known at 2 of 2 points" in note for note in result.notes)


def test_modes_of_a_soft_suspension_stay_elastic_in_the_error_of_the_mesh(tmp_path):
    """Some Hz beside oscillators of 100 kHz: as rigid motions Rayleigh damping refuses them."""
    feet = {
        "name": "feet", "on": "block:-z", "at": [[0.02, 0.01], [-0.02, 0.01], [0.0, -0.01]],
        "kx": 300.0, "ky": 300.0, "kz": 300.0,
    }  # fmt: skip
    hung = BLOCK | {
        "assembly": {"held": [], "material": "steel"},
        "springs": [feet],
        "damping": {"kind": "rayleigh", "alpha": 1.0, "beta": 0.0},
    }
    result = beadwave.scan(hung, grid="2x1", out=tmp_path / "out")
    assert result.counts() == {"done": 2}
    assert np.all(result.columns["error_mesh"] < 0.05)


OTHER = "sphere 5 is blank: not that of the points around"


@pytest.mark.slow
def test_a_later_wave_that_is_picked_is_blank(tmp_path, monkeypatch, scanned):
    planted, measured = (6, 11), scan.measured

    def later(*of, **run):
        table = measured(*of, **run)
        for name, shift in (("reflected_s", 2e-4), ("echo_delay_s", 2e-4), ("echo_ratio", -0.1)):
            for case in planted:
                table[f"sphere_5_{name}"][case] += shift
        return table

    monkeypatch.setattr(scan, "measured", later)
    result = beadwave.scan(BLOCK, grid="5x4", out=tmp_path / "out")
    for name in ("reflected_s", "reflected_m_s", "echo_delay_s", "echo_ratio"):
        values, whole = (one.columns[f"sphere_5_{name}"] for one in (result, scanned))
        assert np.flatnonzero(np.isnan(values)).tolist() == list(planted)
        others = np.delete(np.arange(20), planted)
        assert np.isfinite(whole).all() and np.array_equal(values[others], whole[others])
    assert np.isfinite(result.columns["sphere_5_incident_s"]).all()
    messages = result.columns["message"]
    assert [case for case in range(20) if OTHER in messages[case]] == list(planted)
    assert any("sphere 5 is left blank at 2 of 20 points" in note for note in result.notes)
    assert not scanned.notes and result.plot("sphere_5_echo_delay_s").png


def test_mirrored_points_are_equal(scanned):
    for name in ("sphere_5_echo_ratio", "sphere_5_echo_delay_s", "wall_peak_force_N"):
        result = scanned.columns[name].reshape(5, 4)
        assert np.abs(result / result[::-1] - 1.0).max() < 1e-8
        assert np.abs(result / result[:, ::-1] - 1.0).max() < 1e-8
        assert np.ptp(result) > 1e-5 * np.abs(result).max()


def test_the_map_shows_the_face(scanned):
    assert {p.name for p in scanned.folder.glob("figures/*")} >= {"sphere_5_echo_ratio.png"}
    edges = np.array(scanned.face["edges"])
    assert scanned.face["name"] == "block:+z" and scanned.face["axes"] == ["x", "y"]
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum()
    assert abs(length / (2 * (0.06 + 0.04)) - 1.0) < 1e-9
    again = beadwave.load_sweep(scanned.folder)
    assert again.plot("wall_peak_s").png.startswith(b"\x89PNG")


@pytest.mark.slow
def test_points_in_a_hole_are_rows_that_say_so(tmp_path):
    plate = {"plate": DRILLED, "holes": {"diameter": 0.012, "at": [[0.0, 0.0]]}, "seed": 0.01}
    scene = BLOCK | {"bodies": {"block": plate}}
    result = beadwave.scan(scene, grid="3x3", out=tmp_path / "out")
    assert result.counts() == {"done": 8, "refused": 1}
    assert result.columns["status"][4] == "refused"
    assert "leaves the face" in result.columns["message"][4]
    assert np.isnan(result.columns["wall_peak_force_N"][4])
    assert result.plot("sphere_5_echo_ratio").png


def test_a_finished_scan_is_not_computed_again(scanned, monkeypatch):
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


@pytest.mark.slow
def test_a_scan_is_computed_anew_once_its_mesh_is_another(tmp_path, monkeypatch):
    monkeypatch.setattr(scan, "PART", 1)
    monkeypatch.setattr("beadwave.workflows.sweep.api._draw", lambda *_: None)
    marched, rows = [], scan.Rows
    monkeypatch.setattr(
        scan, "Rows", lambda cases, *rest: marched.extend(cases) or rows(cases, *rest)
    )
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
    result = scanned()
    assert marched == [0, 1] and "a file that it was made of changed" in result.notes[0]
    change = result.columns["wall_peak_force_N"] / old.columns["wall_peak_force_N"] - 1.0
    assert np.abs(change).max() > 0.1 and not list(tmp_path.glob("out/part-*"))


KILLED = """
import beadwave, os, signal
from beadwave.workflows.sweep import scan
scan.PART = 6
def told(done, n):
    if done >= 12:
        os.kill(os.getpid(), signal.SIGKILL)
beadwave.scan({scene}, grid="5x4", out={out!r}, signals=True, told=told)
"""


@pytest.mark.slow
def test_a_killed_scan_goes_on_with_the_points_that_are_missing(tmp_path, scanned, monkeypatch):
    out, marched = tmp_path / "out", []
    script = KILLED.format(scene=BLOCK, out=str(out))
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, timeout=600, capture_output=True, start_new_session=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    parts = {path.name for path in out.glob("part-*.parquet")}
    assert len(parts) == 2 and not list(out.glob("cases.parquet"))
    rows = scan.Rows
    monkeypatch.setattr(scan, "Rows", lambda *of: marched.extend(of[0]) or rows(*of))
    solved, reduced, own, modes = [], [], rom.many_contacts, face.modes
    monkeypatch.setattr(
        rom, "many_contacts", lambda *of: reduced.append(of[2].shape[1]) or own(*of)
    )
    monkeypatch.setattr(face, "modes", lambda *of: solved.append(of) or modes(*of))
    told = []
    result = beadwave.scan(
        BLOCK, grid="5x4", out=out, signals=True, told=lambda *n: told.append(n)
    )  # fmt: skip
    assert told[0] == (12, 20) and told[-1] == (20, 20) and marched == list(range(12, 20))
    assert result.counts() == {"done": 20} and not list(out.glob("part-*"))
    assert not solved
    assert reduced == [8]  # the missing points
    time = max(
        one.columns["error_time"].max() for one in (result, scanned)
    )  # steps of parts differ
    for name, allowed in (
        ("sphere_5_echo_delay_s", time),
        ("wall_peak_force_N", time),
        ("error_mesh", 0.05),
    ):
        assert np.abs(result.columns[name] / scanned.columns[name] - 1.0).max() < allowed
    reduction = (one.columns["error_reduction"] for one in (result, scanned))
    assert np.abs(np.subtract(*reduction)).max() < 2 * time
    v, whole = (one.signals()["v"].to_numpy() for one in (result, scanned))
    # steps depend on the points beside one, and each of both runs is within its error of 0.2 m/s
    stated = result.columns["error_time"] + scanned.columns["error_time"]
    assert (np.abs(v - whole).max(axis=(1, 2)) < 0.2 * stated).all()


def test_points_are_mirrored_to_the_last_digit():
    ends = np.array([[-0.05, -0.02], [0.05, 0.02]])
    struck = SimpleNamespace(
        scene=SimpleNamespace(strike=SimpleNamespace(radius=0.002)),
        outline=lambda: Outline(("y", "z"), *ends, None),
    )
    result = Grid(7, 4).design(struck)
    y, z = (np.array(values).reshape(7, 4) for values in result.columns.values())
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
        (BLOCK, {"strike.at": [0.01, 0.0]}, {}, "sets strike.at itself; drop --set strike.at"),
        (BLOCK, {"strike.on": "block:+x"}, {"face": "block:+z"}, "drop --set strike.on"),
        ("rig-rom", ("patch.point=[0, 0.01]",), {}, "drop --set patch.point"),
        ("rig-rom", {"patch.weights": "thesis"}, {}, "bound to nodes"),
        ("rig-rom", {"joints.head.cx": 10.0, "joints.head.kx": 1e7}, {}, "dashpots"),
    ],
)
def test_impossible_scans_are_refused(tmp_path, scene, changes, options, says):
    with pytest.raises(InvalidScene, match=says):
        beadwave.scan(scene, changes, out=tmp_path / "out", **options)


def test_a_round_face_is_refused(tmp_path):
    bodies = {"block": {"cylinder": {"radius": 0.03, "length": 0.05}, "seed": 0.015}}
    scene = BLOCK | {"bodies": bodies, "strike": {"on": "block:cylinder", "at": [0.03, 0.0, 0.0]}}
    with pytest.raises(InvalidScene, match="plane"):
        beadwave.scan(scene, out=tmp_path / "out")


def test_a_grid_is_read():
    assert grid("20x10") == (20, 10) and grid("3X4") == (3, 4)
