"""Scenes whose structure is told in one table."""

import importlib.util
import json
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from beadwave import fem, rom
from beadwave.coupling.reduced_wall import wall_of
from beadwave.workflows.evidence.accuracy.mesh import mesh
from beadwave.workflows.files.scene import scene
from beadwave.workflows.run.second_process import RUN
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of as wall_of_scene
from beadwave.workflows.stages.chain.waves import waves
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.errors.number_errors import numbers_of
from beadwave.workflows.stages.structure import bending

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache")
EXAMPLES = Path(__file__).parents[2] / "examples"
SHORT = ("time.duration=6e-4", "chain.count=5", "output.spheres=[1, 3]")


def computed(name, *changes):
    return pipeline_of(scene(name, changes), lambda stage: nullcontext())


def test_a_beam_is_the_wall_that_its_matrices_make():
    """K, M, w by hand: the run's wall has no half-space and no other compliance."""
    found = computed("beam", *SHORT)
    table = found.scene.beam
    by_hand = fem.beam(
        table.length, fem.rectangle(table.width, table.thickness, table.poisson),
        fem.Material(table.young, table.poisson, table.density),
        (fem.ENDS["hinged"], fem.ENDS["hinged"]), table.position,
    )  # fmt: skip
    static = by_hand.patch.w @ fem.factorised(by_hand.K).solve(by_hand.patch.w)
    wall = found("wall")
    assert abs((wall.phi**2 / wall.omega**2).sum() / static - 1) < 1e-8
    assert wall.residual_compliance == 0
    assert found("reduction").contact.young == table.young


def test_errors_of_a_beams_numbers_hold_what_other_theories_change():
    """Frequencies and compliance of the full models of the theory corrected by solids and of the
    usual one, by their shares of 1.2 and 0.1; reduced models agree with full ones to 1 % of such a
    difference. The waves of a run before the corrected wall lie within the errors."""
    of = computed("beam", *SHORT, "beam.thickness=0.02", "beam.width=0.016")
    rows = {e.name: e for e in (*of("structure-errors"), *of("quantity-errors"))}
    numbers = []
    for theory in ("own", "solid", "usual"):
        full = bending.model(of.scene, theory=theory)
        w = full.patch.w
        compliance = w @ fem.factorised(full.K).solve(w) - full.half_space
        numbers.append(np.append(fem.modes(full.K, full.M, 8).frequency_hz, compliance))
    own, solid, usual = numbers
    expected = 1.2 * np.abs(solid - own) + 0.1 * np.abs(usual - own)
    names = [*(f"mode {i}" for i in range(1, 9)), "static_compliance_m_per_N"]
    np.testing.assert_allclose([rows[name].theory for name in names], expected, rtol=0.01)
    np.testing.assert_allclose([rows[name].value for name in names], own, rtol=1e-4)
    assert all(rows[name].mesh < 1e-3 * rows[name].theory for name in names)

    better = bending.other_theories(of.scene)[0].reduced
    run = impact(of.scene, of("start"), wall_of_scene(of.scene, better))
    of_run = numbers_of(run.trajectory, waves(of.scene, of("start"), run))
    for name in ("tof_s", "arr_2_9", "peak_wall_force_N"):
        assert 0 < abs(of_run[name][0] - rows[name].value) < rows[name].theory
        assert rows[name].theory < 0.1 * rows[name].value


def test_a_hollow_beam_has_errors_of_its_numbers_without_one_of_the_theory():
    tables = scene("beam", SHORT).model_dump(exclude_none=True)
    tables["beam"] = {
        "length": 0.4, "diameter": 0.02, "bore": 0.012, "young": 210e9, "poisson": 0.3,
        "density": 7850.0, "left": "hinged", "right": "hinged", "position": 0.18,
    }  # fmt: skip
    tables.pop("unusual", None)
    of = pipeline_of(scene(tables), lambda stage: nullcontext())
    rows = (*of("structure-errors"), *of("quantity-errors"))
    assert {"mode 1", "tof_s", "static_compliance_m_per_N"} <= {row.name for row in rows}
    assert all(row.theory is None and row.mesh is not None for row in rows)


def test_the_theory_is_nearer_to_a_solid_than_the_usual_one_and_its_error_holds_the_difference():
    """A clamped and hinged steel beam beside hexahedra: measured 1.3 times the true error, and 3.4
    times as near as Cowper's beam that does not bulge."""
    spec = importlib.util.spec_from_file_location("theory_errors", EXAMPLES / "theory_errors.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    beam = {"thickness": 0.01, "width": 0.015, "length": 0.09, "position": 0.04}
    rng = np.random.default_rng(0)
    ends = {"left": "clamped", "right": "hinged"}
    drawn = example.with_chain("beam", beam | ends, (210e9, 0.3, 7850.0), rng)
    true, corrected, usual, stated = example.errors(drawn)
    assert true < 0.7 * usual and corrected < 0.5 * true
    assert 0.9 < stated / true < 3


def test_a_hollow_section_states_no_error_of_the_theory_and_says_why():
    """It flattens under the sphere, which no beam does: None, not a small number."""
    hollow = ("beam.width=none", "beam.thickness=none", "beam.diameter=20mm", "beam.bore=10mm")
    with pytest.raises(ValueError, match="flattens under the sphere"):
        computed("beam", *SHORT, *hollow)("theory-error")


def test_both_reductions_of_a_beam_give_the_same_waves():
    free = computed("beam", *SHORT)("impact").trajectory
    bounded = computed("beam", *SHORT, "reduction.kind=craig-bampton")("impact").trajectory
    assert np.abs(free.v - bounded.v).max() < 1e-4 * 0.3
    rigid = computed("beam", *SHORT, "wall.kind=rigid")("impact").trajectory
    assert np.abs(free.v - rigid.v).max() > 0.01 * 0.3


def test_a_beam_is_told_with_its_errors_and_its_load(capsys):
    pressed = ("--set=beam.axial_force=-3e3",)
    order = ("impact", "beam", *(f"--set={change}" for change in SHORT), *pressed, "--json")
    assert beadwave(*order) == 0
    summary = json.loads(capsys.readouterr().out)
    assert 0 < summary["error_estimate"]["reduction"] < 1e-3
    assert 0 < summary["error_estimate"]["mesh"] < 1e-3
    assert 1e-3 < summary["error_estimate"]["theory"] < 0.1
    kGA = fem.rectangle(0.02, 0.01, 0.3).shear_factor * 210e9 / 2.6 * 2e-4
    euler = np.pi**2 * 210e9 * 0.02 * 0.01**3 / 12 / 0.5**2
    assert summary["load_factor"] == pytest.approx(3e3 / (euler / (1 + euler / kGA)), rel=1e-6)
    assert beadwave("modes", "beam", *pressed) == 0
    assert "of the load that buckles it" in capsys.readouterr().out


REFUSED = {
    ("beam.axial_force=-2e4",): "of the buckling load of",
    ("beam.axial_force=-1e3", "beam.left=free", "beam.right=free"): "can move as a rigid body",
    ("beam.position=0.5",): "position = 0.5 m must be below length = 0.5 m",
    ("beam.left=glued",): "beam.left",
    ("beam.bore=0.001",): "bore belongs to diameter",
    ("beam.area=1e-4",): "area and second_moment belong together",
    ("beam.area=1e-4", "beam.second_moment=1e-9"): "add shear_factor",
    ("beam.diameter=0.02", "beam.bore=0.02"): "bore = 0.02 m must be below diameter",
    ("beam.thickness=1",): "a section 1 m high is no beam of length = 0.5 m",
    ("beam.width=10",): "10 mm",
    ("patch.radius=0.002",): "[patch] contradicts [beam]",
    ("preload.force=1", "beam.left=free", "beam.right=free"): "preload.force",
    ("reduction.kind=craig-bampton", "beam.left=free", "beam.right=free"): '"free-modes"',
}


@pytest.mark.parametrize("changes", REFUSED)
def test_a_beam_that_cannot_be_is_refused_in_a_sentence(changes, capsys):
    assert beadwave("impact", "beam", *(f"--set={change}" for change in changes)) == 2
    told = capsys.readouterr().err
    assert REFUSED[changes] in told and "Traceback" not in told and told.count("\n") <= 2


@pytest.mark.parametrize(
    ("key", "says"),
    [("right", "add 'hinged', 'clamped' or 'free'."), ("young", "add it."), ("length", "add it.")],
)
def test_a_key_of_few_words_that_is_missing_is_asked_for_with_them(key, says, tmp_path, capsys):
    table = (
        'length=1\nwidth=0.1\nthickness=0.1\nyoung=7e10\ndensity=2700\nleft="free"\nright="free"'
    )
    rest = [line for line in table.splitlines() if not line.startswith(key)]
    (tmp_path / "mine.toml").write_text("\n".join(["[beam]", *rest, "position=0.5"]))
    assert beadwave("modes", str(tmp_path / "mine.toml")) == 2
    assert capsys.readouterr().err.strip().endswith(f"beam.{key} is missing; {says}")


SMALL = ("plate.length=0.16", "plate.width=0.12", "plate.at=[0.07, 0.05]", "reduction.modes=20")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "changes"), [("slender-beam", ()), ("plate", (*SMALL, *SHORT))])
def test_the_stated_error_of_the_elements_is_that_against_finer_ones(name, changes):
    """Between 1 and 3 times it; frequencies and waves get better from mesh to mesh."""
    chosen = scene(name, changes)
    found = mesh(chosen, lambda stage: nullcontext())
    errors = {row.parameter: row.error for row in found.tables[0].rows}
    stated = computed(name, *changes)("mesh-error")
    # of two meshes that have converged: what the marches between them differ by, 0.7e-6 to 1.1e-6
    # on two processors
    rounding = 3e-6
    assert f"{stated:.1e}" in found.sentences[0]
    assert errors[1.0] < rounding or 1 < stated / errors[1.0] < 3
    assert errors[1.0] < errors[2.0] and errors[min(errors)] < max(errors[1.0], rounding)
    first = [row[7] for row in found.tables[1].rows]
    assert first[-2] < 1e-6 and len(first) == 5
    assert found.pictures[0].name == "mesh"


def test_a_plate_of_many_waves_has_a_finer_second_mesh_as_any(monkeypatch):
    """A coarser one may be off by less than the run's own, and state a third of its error."""
    asked = []

    def model(scene, coarser):
        asked.append(coarser)
        raise InvalidScene("seen")

    monkeypatch.setattr(bending, "model", model)
    with pytest.raises(InvalidScene, match="seen"):
        bending.second_mesh(scene("plate", ("plate.length=0.9", "plate.width=0.8")))
    assert asked == [2**-0.5]


PLATE = ("time.duration=4e-4", "chain.count=4", "output.spheres=[1, 3]", "reduction.modes=60")


def test_a_plate_is_the_wall_that_its_matrices_make_less_what_the_disc_adds():
    found = computed("plate", *PLATE)
    table, reduced, wall = found.scene.plate, found("reduction"), found("wall")
    steel = fem.Material(table.young, table.poisson, table.density)
    sheet = fem.Sheet(table.length, table.width, table.thickness, steel)
    by_hand = fem.mindlin_plate(sheet, ("hinged",) * 4, table.at)
    static = by_hand.patch.w @ fem.factorised(by_hand.K).solve(by_hand.patch.w)
    assert wall.residual_compliance == -by_hand.half_space < 0
    assert abs((wall.phi**2 / wall.omega**2).sum() / static - 1) < 1e-6
    assert reduced.surface.bodies == ("plate",) and reduced.mass.mass == by_hand.mass
    assert found("reduction-error") < 1e-3
    assert found("impact").verdict.passive


@pytest.mark.slow
def test_a_pressed_plate_tells_its_share_of_the_buckling_force(capsys):
    pressed = ("--set=plate.in_plane_x=-1 kN/mm", "--set=plate.in_plane_y=0.2 kN/mm")
    assert beadwave("modes", "plate", *pressed, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    D, S = 210e9 * 0.008**3 / 12 / 0.91, 5 / 5.7 * 210e9 / 2.6 * 0.008
    x2, y2 = (np.pi * np.arange(1, 5) / 0.3) ** 2, (np.pi / 0.2) ** 2
    k2 = x2 + y2
    mu = ((1e6 * x2 - 0.2e6 * y2) * (1 + D * k2 / S) / (D * k2**2)).max()
    assert found["load_factor"] == pytest.approx(mu, rel=1e-5)
    assert beadwave("modes", "plate", "--json") == 0
    free = json.loads(capsys.readouterr().out)
    first, unloaded = (one["rows"][0]["frequency_hz"] for one in (found, free))
    assert free["load_factor"] is None and first < 0.98 * unloaded


NO_PLATE = {
    ("plate.thickness=0.1",): "must be up to a quarter of the shorter side",
    ("plate.at=[0.004, 0.1]",): "allowed are 0.008 to 0.292 m",
    ("plate.left=glued",): "plate.left",
    ("beam.length=1",): "beam.young is missing",
    ("mesh.scale=2",): "[mesh] contradicts [plate]",
    ("plate.in_plane_y=-2e7",): "plate.in_plane_x, plate.in_plane_y: forces in the plane of 0 N/m",
    ("plate.in_plane_x=1e5", *(f"plate.{e}=free" for e in ("left", "right", "front", "back"))): (
        "plate.in_plane_x = 100000 acts on a plate that can move as a rigid body"
    ),
    ("reduction.kind=craig-bampton", *(f"plate.{e}=free" for e in ("right", "front", "back"))): (
        '"craig-bampton" needs a plate that is held'
    ),
    ("plate.length=20", "plate.width=20", "plate.thickness=0.001"): "unknowns",
}


@pytest.mark.parametrize("changes", NO_PLATE)
def test_a_plate_that_cannot_be_is_refused_in_a_sentence(changes, capsys):
    assert beadwave("impact", "plate", *(f"--set={change}" for change in changes)) == 2
    told = capsys.readouterr().err
    assert NO_PLATE[changes] in told and "Traceback" not in told and told.count("\n") <= 2


def test_what_needs_an_assembly_says_so_of_a_beam(capsys):
    for order in (
        ("tune", "beam", "--match=1"),
        ("look", "beam"),
        ("modes", "beam", "--inp=a"),
    ):
        assert beadwave(*order) == 2
        assert "[assembly]" in capsys.readouterr().err


@pytest.mark.parametrize("section", ["diameter=0.02", "diameter=0.03"])
def test_a_round_section_replaces_the_rectangle(section):
    changes = (f"beam.{section}", *(("beam.bore=0.02",) if "3" in section else ()))
    found = scene("beam", changes)
    assert found.beam.width is None and found.beam.diameter
    assert len(computed("beam", *changes)("modes").omega) == 30


def test_a_beam_on_springs_takes_a_table(tmp_path):
    path = tmp_path / "springs.toml"
    text = scene_text("beam").replace('left = "hinged"', "left = { shift = 1e6, turn = 50.0 }")
    path.write_text(text)
    soft = computed(str(path))("modes").omega[0]
    stiff = computed(str(path), "beam.left.shift=1e9")("modes").omega[0]
    assert soft < 0.995 * stiff


def scene_text(name):
    from beadwave.workflows.files.scene import scene_text as text

    return text(name).text


def test_a_beam_that_floats_has_the_wall_of_a_free_body():
    wall = computed("beam", "beam.left=free", "beam.right=free")("wall")
    assert np.count_nonzero(wall.omega == 0) == 2


def test_a_beam_asks_for_no_mesher():
    """Nor for the viewer; a run draws in a process of its own."""
    code = (
        "import sys; from contextlib import nullcontext\n"
        "from beadwave.workflows.files.scene import scene\n"
        "from beadwave.workflows.stages.engine.pipeline import pipeline_of\n"
        "pipeline_of(scene('beam', ('time.duration=2e-4',)), lambda s: nullcontext())('wall')\n"
        "print(*({'gmsh', 'pyvista', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_file_of_a_reduced_beam_is_its_wall(tmp_path):
    assert beadwave("reduce", "beam", "--out", tmp_path / "rom.npz") == 0
    assert beadwave("reduce", "beam", "--out", "own.npz", "--matrices", "full.npz") == 0
    full = np.load("full.npz", allow_pickle=True)
    assert len(full["mesh_points"]) == 121 * 4
    kept, own = rom.load_npz(tmp_path / "rom.npz"), computed("beam")("reduction")
    assert np.array_equal(kept.w, own.w) and kept.contact.half_space == 0
    assert np.allclose(wall_of(kept).omega, wall_of(own).omega)


@pytest.mark.parametrize("key", ["thickness", "young", "length", "position"])
def test_an_unusable_number_is_refused(key):
    with pytest.raises(InvalidScene, match=f"beam.{key}"):
        scene("beam", (f"beam.{key}=-1.0",))


@pytest.mark.parametrize("name", ["beam", "plate"])
def test_no_stage_of_a_run_reads_what_a_beam_or_a_plate_lacks(name):
    """The key of a stage holds all that it and the stages before it read."""
    stages = pipeline_of(scene(name), lambda stage: nullcontext())
    of_solids = {"half-space", "missed-energy"}
    asked_for = [stage for stage in RUN if stage not in of_solids]
    keys = [
        stages.key(stage) for stage in (*asked_for, "mode-files", "model-files", "response-files")
    ]
    assert len(set(keys)) == len(keys)
