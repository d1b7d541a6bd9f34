"""Friction and arm of a scene: keys, refusals, results of an oblique impact."""

import json
import re

import numpy as np
import pytest
import tomli_w

from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.page_data import ledger
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import toml

from command_line import beadwave

ONE_MASS = {"wall": {"kind": "1dof", "frequency": 500.0, "mass": 1.0}}
NO_FRICTION = {
    "chain": {"count": 1, "radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.1},
    "wall": {"kind": "half-space"},
}

pytestmark = pytest.mark.usefixtures("own_folder")


REFUSED = {
    "friction.coefficient = -0.1 must be greater than or equal to 0": {
        "friction.coefficient": -0.1
    },
    "friction.coefficient is missing": {"friction": {}},
    "the tangential law of contacts that yield": {
        "contact.law": "thornton",
        "contact.yield_pressure": 1e9,
    },
    'contact.dissipation = "linear", whose force': {
        "contact.dissipation": "linear",
        "contact.coefficient": 1.0,
    },
    "contact.stiffness_factor = 3 at the wall": {"contact.stiffness_factor": 3.0},
    'wall.kind = "dashpot", allowed are': {"wall": {"kind": "dashpot", "coefficient": 1e3}},
    "wall.young is missing; with [friction]": ONE_MASS,
    "wall.poisson is missing; with [friction]": {"wall": ONE_MASS["wall"] | {"young": 210e9}},
    "weighs across the chain, which nothing carries": {"gravity.inclination": 30.0},
    "is that of a chain of one sphere, found chain.count = 3": {
        "chain.count": 3,
        "output.spheres": [1, 3],
    },
    "arm.stiffness = inf, which clamps": {"arm.stiffness": float("inf")},
    "which has no contact between spheres": {"friction.between_spheres": 0.2},
    "friction.between_spheres = -1.0 must be": {"friction.between_spheres": -1.0},
    "arm.stiffness has 3 values": {"arm.stiffness": [1.0, 2.0, 3.0]},
    "[guides] hold the last sphere": {"guides.force": 0.1},
    "must be up to 10 kg m^2": {"arm.inertia": 20.0},
    "tangential_velocity = [0.1] has 1 value; give 2.": {"striker.tangential_velocity": [0.1]},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_friction_does_not_take_is_refused_in_a_sentence(sentence):
    with pytest.raises(InvalidScene, match=re.escape(sentence)) as refused:
        scene("oblique-sphere", REFUSED[sentence])
    assert str(refused.value).endswith(".")


def test_what_acts_on_nothing_is_refused(tmp_path):
    for tables, sentence in (
        ({"arm": {"stiffness": 1e6}}, r"\[arm\] holds"),
        ({"striker": {"velocity": 0.1, "tangential_velocity": [0.1, 0.0]}}, "needs friction"),
        ({"friction": {"coefficient": 0.2}, "wall": None}, r"needs? .*wall|add \[wall\]"),
    ):
        given = {**NO_FRICTION, **tables}
        if given["wall"] is None:
            del given["wall"]
            given["chain"] = given["chain"] | {"count": 2}
        (tmp_path / "s.toml").write_text(tomli_w.dumps(given))
        with pytest.raises(InvalidScene, match=sentence):
            scene(str(tmp_path / "s.toml"))


def test_a_resolved_scene_with_friction_reads_back(tmp_path):
    first = scene("oblique-sphere", {"arm.stiffness": "2 MN/m", "arm.inertia": "100 kg mm^2"})
    assert first.arm.stiffness == 2e6 and first.arm.inertia == pytest.approx(1e-4)
    (tmp_path / "s.toml").write_text(toml(first))
    assert scene(str(tmp_path / "s.toml")) == first


def test_an_oblique_impact_is_that_of_maw_barber_and_fawcett(tmp_path, capsys):
    assert beadwave("impact", "oblique-sphere", "--out=o", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    across = summary["friction"]
    assert across["surface_velocity_ratio"] == pytest.approx(-0.4599, abs=1e-4)
    assert across["spin_rad_s"][0] == 0.0
    assert summary["error_estimate"]["time"] < 1e-5
    assert summary["energy_error"] < 1e-6
    run = dict(np.load(tmp_path / "o" / "trajectory.npz"))
    assert run["friction_force"].shape == run["slip"].shape == (2001, 2)
    assert np.all(np.diff(run["dissipated_friction"]) >= 0.0)
    # friction never exceeds its bound, and the whole ledger closes
    bound = 0.2 * run["contact_force"][:, -1]
    assert np.all(np.abs(run["friction_force"][:, 0]) <= bound + 1e-5 * bound.max())
    total = run["energy_total"]
    assert np.abs(total - total[0]).max() < 1e-6 * total[0]
    _, changes = ledger(run)[-1]
    assert np.abs(changes - changes[0]).max() < 1e-6 * total[0]


def test_slip_throughout_loses_coulombs_impulse_by_a_scene(capsys):
    v = 0.3
    beadwave("impact", "oblique-sphere", "--json", f"--set=striker.tangential_velocity=[0.0, {v}]")
    across = json.loads(capsys.readouterr().out)["friction"]
    assert across["surface_velocity_ratio"] == pytest.approx(1 - 7 * 0.2 * 0.1 / v, abs=1e-6)
    assert across["spin_rad_s"][0] > 0.0 and abs(across["spin_rad_s"][1]) < 1e-9


def test_friction_leaves_the_motion_along_the_chain_alone(tmp_path):
    """Bit for bit: the march along the chain is that without friction."""
    (tmp_path / "plain.toml").write_text(tomli_w.dumps(NO_FRICTION))
    with_friction = NO_FRICTION | {"friction": {"coefficient": 0.2}}
    with_friction["striker"] = {"velocity": 0.1, "tangential_velocity": [0.05, 0.02]}
    (tmp_path / "rough.toml").write_text(tomli_w.dumps(with_friction))
    for name in ("plain", "rough"):
        assert beadwave("impact", f"{name}.toml", f"--out={name}", "--quiet") == 0
    plain, rough = (dict(np.load(tmp_path / n / "trajectory.npz")) for n in ("plain", "rough"))
    for name in plain.keys() - {"energy_total"}:
        assert np.array_equal(plain[name], rough[name]), name
    assert "friction_force" not in plain


@pytest.mark.slow
def test_a_chain_pressed_on_the_wall_keeps_its_last_sphere_at_rest_across(capsys):
    """Nothing moves a guided chain across: friction has nothing to do."""
    pressed = ("friction.coefficient=0.3", "arm.stiffness=1e6", "preload.force=20")
    sets = [f"--set={change}" for change in (*pressed, "time.duration=1e-3")]
    beadwave("impact", "rig-half-space", "--json", *sets)
    across = json.loads(capsys.readouterr().out)["friction"]
    assert across["dissipated_J"] == 0.0 and across["velocity_m_s"] == [0.0, 0.0]
    assert across["surface_velocity_ratio"] is None


def test_a_sweep_over_the_coefficient_shows_friction(tmp_path, capsys):
    """As all slips, the surface keeps 1 - 7 mu v_n / v_t; a refused case has no numbers."""
    pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    sets = ("--set=striker.tangential_velocity=[0.5,0.0]", "--out=s")
    over = "--over=friction.coefficient=0.1,0.2,-0.3"
    assert beadwave("sweep", "oblique-sphere", over, *sets) == 0
    capsys.readouterr()
    table = pq.read_table(tmp_path / "s" / "cases.parquet").to_pydict()
    assert table["status"] == ["done", "done", "refused"]
    expected = [1.0 - 7.0 * mu * 0.1 / 0.5 for mu in (0.1, 0.2)]
    assert table["surface_velocity_ratio"][:2] == pytest.approx(expected, abs=1e-6)
    assert table["friction_heat_J"][1] > table["friction_heat_J"][0] > 0.0
    assert np.isnan(table["surface_velocity_ratio"][2])
    assert np.isnan(table["loop_energy_J"][0])


@pytest.mark.slow
def test_friction_between_spheres_acts_with_its_coefficient_and_the_ledger_closes(capsys):
    """A chain on a shaken wall: without friction there, by a coefficient of 0, and of 0.5."""
    shaker = "{name='shaker', on='wall', direction='y', frequency=2000.0, displacement=2e-5}"
    sets = [f"--set={change}" for change in (*RIG, f"shakers=[{shaker}]")]
    runs = []
    for between in (
        [],
        ["--set=friction.between_spheres=0"],
        ["--set=friction.between_spheres=0.5"],
    ):
        assert beadwave("impact", "rig-half-space", "--json", *sets, *between) == 0
        runs.append(json.loads(capsys.readouterr().out))
    absent, smooth, rough = (run["friction"]["dissipated_J"] for run in runs)
    assert smooth == pytest.approx(absent, rel=1e-3)  # by other steps; time.error is 1e-4
    assert abs(rough / absent - 1.0) > 0.02
    assert max(run["energy_error"] for run in runs) < 1e-4


def test_unlike_materials_are_told(capsys):
    beadwave("impact", "oblique-sphere", "--json", "--set=wall.young=70e9")
    (warning,) = json.loads(capsys.readouterr().out)["warnings"]
    assert "Dundurs' constant is -0.14" in warning


# --- shaken walls ---------------------------------------------------------------------------------

GROSS_LOOP = 12497.175e-9  # J, of the force +- mu P
CLOSED = [  # amplitude, energy of a loop, force over mu P: Johnson (1985), 7.57
    (136.3115e-9, 43.48492e-9, 0.25),
    (289.0280e-9, 440.1144e-9, 0.5),
    (2e-6, GROSS_LOOP + 4.0 * 20.0 * (2e-6 - 0.7810734557e-6), 1.0),
]


@pytest.mark.parametrize(("amplitude", "energy", "share"), CLOSED)
def test_loops_of_a_shaken_plane_are_those_of_the_closed_form(amplitude, energy, share, capsys):
    beadwave("impact", "shaken-plane", "--json", f"--set=shakers.shaker.displacement={amplitude}")
    summary = json.loads(capsys.readouterr().out)
    across = summary["friction"]
    assert across["loop_energy_J"] == pytest.approx(energy, abs=1e-6 * GROSS_LOOP)
    assert across["loop_displacement_m"] == pytest.approx(amplitude, rel=1e-6)
    assert across["loop_tangential_N"] == pytest.approx(20.0 * share, rel=1e-6)
    assert across["periodicity_error"] < 1e-9
    assert across["phase_at_wall_deg"] is None and summary["warnings"] == []
    assert summary["waves"] == {} and summary["energy_error"] < 1e-6
    # the run is one period more of the same loop
    assert across["dissipated_J"] == pytest.approx(energy, abs=1e-6 * GROSS_LOOP)


def test_velocity_and_acceleration_are_amplitudes_of_the_same_motion(capsys):
    omega, loops = 2.0 * np.pi * 10.0, []
    for change in (
        "displacement=2e-7",
        f"velocity={2e-7 * omega}",
        f"acceleration={2e-7 * omega**2}",
    ):
        beadwave("impact", "shaken-plane", "--json", f"--set=shakers.shaker.{change}")
        loops.append(json.loads(capsys.readouterr().out)["friction"]["loop_energy_J"])
    assert loops == pytest.approx([loops[0]] * 3, rel=1e-9)


SHAKEN = {
    'shakers.shaker.on = "block:-x", allowed is "wall"': {"shakers.shaker.on": "block:-x"},
    "direction = [0.0, 0.0, 0.0] has no length": {"shakers.shaker.direction": [0.0, 0.0, 0.0]},
    "moves the wall along the chain": {"shakers.shaker.direction": "normal"},
    'direction = "up", allowed are': {"shakers.shaker.direction": "up"},
    "shakers.shaker.stinger = 1e+06 N/m": {"shakers.shaker.stinger": 1e6},
    "nothing presses the last sphere on": {"preload.force": 0.0},
    "shakers.shaker.at is of a place": {"shakers.shaker.at": [0.0, 0.0]},
}


@pytest.mark.parametrize("sentence", SHAKEN)
def test_what_does_not_shake_a_wall_is_refused_in_a_sentence(sentence):
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        scene("shaken-plane", SHAKEN[sentence])


def test_shakers_without_an_amplitude_a_period_or_a_name_of_their_own_are_refused():
    base = {"name": "a", "on": "wall", "direction": "y", "frequency": 10.0, "displacement": 1e-7}
    other = base | {"name": "b", "frequency": 10.0 * np.sqrt(2.0)}
    bare = {key: value for key, value in base.items() if key != "displacement"}
    for shakers, sentence in (
        ([base, other], "no common period"),
        ([base, base], "stands twice"),
        ([bare], "has no amplitude"),
        ([base | {"force": 1.0}], "displacement and force, which exclude each other"),
        ([bare | {"force": 1.0}], "whose mass along itself is not known"),
    ):
        with pytest.raises(InvalidScene, match=sentence):
            scene("shaken-plane", {"shakers": shakers})


BAD = (
    ("oblique-sphere", "friction.coefficient=-0.1"),
    ("oblique-sphere", "friction.coefficient=nan"),
    ("oblique-sphere", "contact.law=thornton"),
    ("oblique-sphere", "contact.stiffness_factor=3"),
    ("oblique-sphere", "striker.tangential_velocity=[inf, 0.0]"),
    ("oblique-sphere", "striker.tangential_velocity=fast"),
    ("oblique-sphere", "chain.count=3"),
    ("shaken-plane", "arm.stiffness=-1.0"),
    ("shaken-plane", "arm.rotation=nan"),
    ("shaken-plane", "shakers.shaker.direction=[0.0, 0.0, 0.0]"),
    ("shaken-plane", "shakers.shaker.direction=[nan, 1.0, 0.0]"),
    ("shaken-plane", "shakers.shaker.force=1 N"),
    ("shaken-plane", "shakers.shaker.frequency=0"),
    ("shaken-plane", "shakers.shaker.displacement=nan"),
    ("shaken-plane", "shakers.shaker.phase=400"),
    ("shaken-plane", "shakers.other.phase=90"),
    ("shaken-plane", "preload.force=0"),
)


@pytest.mark.parametrize(("name", "change"), BAD)
def test_bad_input_ends_in_one_sentence_that_names_the_key_and_in_status_2(name, change, capsys):
    assert beadwave("impact", name, f"--set={change}") == 2
    error = capsys.readouterr().err
    assert change.partition("=")[0].split(".")[-1] in error or "chain.count" in error
    assert "Traceback" not in error and len(error.strip().splitlines()) <= 3


RIG = (
    "friction.coefficient=0.2", "arm.stiffness=2e6", "arm.rotation=inf", "preload.force=60",
    "chain.count=6", "output.spheres=[1,6]", "time.duration=1e-3",
)  # fmt: skip
SHAKER = {
    "name": "shaker", "on": "wall", "direction": "y", "frequency": 100.0, "displacement": 2e-5,
}  # fmt: skip


def test_a_wave_meets_the_shaken_contact_at_its_phase(tmp_path, capsys):
    """A chain strikes a wall that slides below its last sphere: before it the motion is periodic,
    the ledger closes with the shaker's work, and friction's state depends on the phase."""
    states = {}
    for phase in (0.0, 90.0):
        shaker = "{" + ", ".join(f"{k} = {v!r}" for k, v in (SHAKER | {"phase": phase}).items())
        sets = [f"--set={change}" for change in (*RIG, f"shakers=[{shaker}}}]")]
        out = tmp_path / f"o{phase:g}"
        assert beadwave("impact", "rig-half-space", "--json", f"--out={out}", *sets) == 0
        summary = json.loads(capsys.readouterr().out)
        across = summary["friction"]
        # a hundredth of time.error, which is 1e-4
        assert across["periodicity_error"] < 1e-6
        assert across["loop_periods"] == 1
        assert summary["energy_error"] < 1e-4
        run = dict(np.load(out / "trajectory.npz"))
        assert run["cycle_t"][-1] == pytest.approx(0.0, abs=1e-12)
        loop = run["cycle_friction_force"][:, 0]
        assert run["friction_force"][0, 0] == pytest.approx(loop[-1], abs=1e-6 * np.ptp(loop))
        late = (100.0 * 360.0 * run["t"][-1] + phase) % 360.0
        assert phase < across["phase_at_wall_deg"] < late
        states[phase] = across["state_at_impact"], across["stick_share_at_impact"]
    # at its turning point the wall sticks, at its fastest it slips as a whole
    assert states[90.0][0] == "gross slip" and states[0.0][1] > 0.5
