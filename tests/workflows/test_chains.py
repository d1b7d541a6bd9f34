"""Several chains on one structure from their scene to their files, and what is refused."""

import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

import beadwave
from beadwave import InvalidScene
from beadwave.coupling.reduced_structure import structure_of
from beadwave.dem import space
from beadwave.rom import full_order
from beadwave.workflows.report.packing import unpacked
from beadwave.workflows.report.page_data import page_data
from beadwave.workflows.scene.places import sensor_places, shaker_places
from beadwave.workflows.scene.toml import toml
from beadwave.workflows.stages.chain.several import start
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure.functionals import bodies_of_faces, functional

from command_line import beadwave as command

SPHERES = {"radius": 6e-3, "material": "bearing-steel"}
PLATE = {
    "assembly": {"held": ["plate:-x"], "material": "steel"},
    "bodies": {"plate": {"box": [0.08, 0.05, 0.01]}},
    "mesh": {"scale": 3.0},
    "damping": {"kind": "modal", "ratio": 0.005},
    "time": {"duration": 4e-4, "error": 1e-5},
    "output": {"samples": 401, "spheres": [2]},
}
TOP = {"name": "top", "on": "plate:+z", "at": [0.01, 0.0], "count": 4, **SPHERES,
       "striker": {"velocity": 0.3}}  # fmt: skip
END = {"name": "end", "on": "plate:+x", "count": 3, **SPHERES,
       "striker": {"velocity": 0.2, "time": 3e-5}}  # fmt: skip
TWO = PLATE | {"chains": [TOP, END]}
SHAKER = {"name": "motor", "on": "plate:-z", "direction": "z", "frequency": 500, "force": 20.0}


@pytest.fixture(scope="module")
def struck():
    return beadwave.impact(TWO)


def test_arrays_hold_all_chains_in_order_and_the_summary_each_by_its_name(struck):
    a, summary = struck.arrays, struck.summary
    shapes = {"x": (401, 7), "v": (401, 7), "contact_force": (401, 7), "chain": (7,),
              "wall_x": (401, 2), "rest": (7, 3), "error_v": (7,)}  # fmt: skip
    assert {name: a[name].shape for name in shapes} == shapes
    assert a["chain"].tolist() == [0] * 4 + [1] * 3
    assert a["v"][0].tolist() == [0.3, 0, 0, 0, 0.2, 0, 0]
    assert a["x"][0, 4] == pytest.approx(-0.2 * 3e-5)
    assert set(summary.chains) == {"top", "end"}
    for name, last in (("top", 3), ("end", 6)):
        chain = summary.chains[name]
        assert chain.peak_wall_force_N == pytest.approx(a["contact_force"][:, last].max())
        assert set(chain.waves) == {"2"} and chain.errors.time <= 1e-5
        assert 0.0 < chain.errors.reduction < 2e-3
    # the last spheres touch the faces that they lean on
    np.testing.assert_allclose(a["rest"][3] - [0.0, 0.0, 6e-3], [0.01, 0.0, 0.005], atol=1e-12)
    np.testing.assert_allclose(a["rest"][6] - [6e-3, 0.0, 0.0], [0.04, 0.0, 0.0], atol=1e-12)
    # forces move spheres: impulse of what presses a sphere from both sides
    mass = 7850 * 4 / 3 * np.pi * 6e-3**3
    net = np.trapezoid(a["contact_force"][:, 0] - a["contact_force"][:, 1], a["t"])
    assert net == pytest.approx((a["v"][-1, 1] - a["v"][0, 1]) * mass, rel=0.02)
    assert summary.energy_error < 1e-7
    data = struck.data
    assert data.v.where(data.chain == 1, drop=True).sizes["sphere"] == 3


DRUM = {
    "assembly": {"held": ["drum:-z"], "material": "steel"},
    "bodies": {"drum": {"cylinder": {"radius": 0.02, "length": 0.03}}}, "mesh": {"scale": 2.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "place", "of_several", "of_one"),
    [
        ({}, {}, {}, {}),
        # 5 % of the striker's velocity over the march
        ({}, {}, {"gravity": {"direction": [0.3, 0.0, -0.4], "acceleration": 30}},
         {"gravity": {"inclination": 53.130102354156, "acceleration": 30}}),
        (DRUM, {"on": "drum:cylinder", "at": [0.02, 0.0, 0.0]}, {}, {}),
    ],
    ids=["plane", "weight", "curved"],
)  # fmt: skip
def test_one_of_several_is_the_chain_alone_on_the_structure(changes, place, of_several, of_one):
    """Another reduction and another march of the same: within the errors that both state."""
    row = TOP | place
    several = beadwave.impact(PLATE | changes | of_several | {"chains": [row]})
    alone = PLATE | changes | of_one | {
        "chain": {key: row[key] for key in ("count", "radius", "material")},
        "striker": row["striker"], "wall": {"kind": "rom"},
        "strike": {"on": row["on"], "at": row["at"]},
        "reduction": {"kind": "free-modes", "error": 1e-4},
    }  # fmt: skip
    one = beadwave.impact(alone)
    difference = np.abs(several.arrays["v"] - one.arrays["v"]).max() / 0.3
    stated = sum(e.time + e.reduction for e in (
        several.summary.error_estimate, one.summary.error_estimate))  # fmt: skip
    assert difference < stated < 5e-3
    both = several.summary.chains["top"].peak_wall_force_N, one.summary.peak_wall_force_N
    assert both[0] == pytest.approx(both[1], rel=5e-3)
    radius = several.summary.chains["top"].contact_radius_m
    assert radius == pytest.approx(one.summary.contact_radius_m, rel=5e-3)


def test_two_chains_on_the_reduced_structure_move_as_on_the_whole(struck):
    """All modes of the mesh in the place of the reduced ones: within the stated error."""
    pipeline = pipeline_of(struck.scene, quiet)
    model, contacts = pipeline("model"), pipeline("chain-contacts")
    square, shapes = eigh(model.K.toarray(), model.M.toarray())
    whole = full_order(np.diag(square), np.eye(len(square)), shapes.T @ contacts.w[:, 0])
    full = structure_of(
        whole, shapes.T @ contacts.w, [0, 1], contacts.direction, contacts.half_space,
        damping=beadwave.coupling.ModalDamping(0.005), cutoff_hz=1e9,
    )  # fmt: skip
    assert full.omega.size == len(square) > 5 * pipeline("structure").omega.size
    first = start(struck.scene, contacts, full)
    march = space.march(
        first.rows.packing, full, first.rows.velocity, duration=4e-4, dt=struck.summary.dt_s,
        n_save=400,
    )  # fmt: skip
    v = np.hstack([run.v for run in space.row_runs(first.rows, full, march)])
    true = np.abs(v - struck.arrays["v"]).max() / 0.3
    assert true < struck.summary.error_estimate.reduction


def test_a_chain_feels_the_other_through_the_structure(struck):
    alone = beadwave.impact(PLATE | {"chains": [TOP, END | {"striker": None}]} | {"striker": None})
    change = np.abs(alone.arrays["v"][:, :4] - struck.arrays["v"][:, :4]).max() / 0.3
    assert change > 100 * struck.summary.error_estimate.time


def test_a_later_striker_moves_its_waves_alone(struck):
    later = beadwave.impact(TWO, {"chains.end.striker.time": "80 us"})
    before, after = (run.summary.chains["end"].waves["2"].arrivals[0] for run in (struck, later))
    assert after.time_s - before.time_s == pytest.approx(5e-5, rel=0.02)
    assert later.arrays["x"][0, 4] == pytest.approx(-0.2 * 8e-5)


def alone_on_plate(row, **tables):
    """The scene of one [chain] in the place of one of several."""
    return PLATE | tables | {
        "chain": {key: row[key] for key in ("count", "radius", "material")},
        "striker": row["striker"], "wall": {"kind": "rom"},
        "strike": {"on": row["on"], "at": row["at"]},
        "reduction": {"kind": "free-modes", "error": 1e-4},
    }  # fmt: skip


def test_one_of_several_that_rubs_is_the_chain_alone_with_friction():
    """At a place without symmetry. Without what the mesh couples in the half-space friction would
    be 18 % off on this mesh."""
    row, rubs = TOP | {"at": [0.01, 0.003]}, {"friction": {"coefficient": 0.2}}
    several = beadwave.impact(PLATE | {"chains": [row | rubs]})
    one = beadwave.impact(alone_on_plate(row, **rubs))
    a, b = several.arrays, one.arrays
    stated = sum(run.summary.error_estimate.time for run in (several, one))
    assert np.abs(a["v"] - b["v"]).max() < stated * 0.3 < 1e-5
    assert np.abs(a["sphere_t_v"][:, 0] - b["sphere_t_v"]).max() < stated * 0.3
    for name, share in (("friction_force", 2e-3), ("slip", 1e-3), ("wall_t", 1e-3)):
        peak = np.abs(b[name]).max()
        assert np.abs(a[name][:, 0] - b[name]).max() < share * peak, name
    mine, other = several.summary.chains["top"].friction, one.summary.friction
    assert mine.peak_friction_N == pytest.approx(other.peak_friction_N, rel=2e-3)
    assert mine.dissipated_J == pytest.approx(other.dissipated_J, rel=5e-3)
    assert mine.gross_slip_m == pytest.approx(other.gross_slip_m, rel=1e-4)
    assert several.summary.error_estimate.reduction < 1e-4
    assert a["rubbing"].tolist() == [0] and several.data.slip.dims == ("time", "contact", "across")


def test_one_of_several_that_yields_is_the_chain_alone():
    yields = {"contact": {"law": "thornton", "yield_pressure": 1.5e9}}
    several = beadwave.impact(PLATE | {"chains": [TOP | yields]})
    one = beadwave.impact(alone_on_plate(TOP, **yields))
    stated = sum(
        error.time + error.reduction
        for error in (run.summary.error_estimate for run in (several, one))
    )
    assert np.abs(several.arrays["v"] - one.arrays["v"]).max() < stated * 0.3 < 3e-4
    assert any("contacts yield; the one" in words for words in several.summary.warnings)


def test_each_chain_has_its_own_friction_arm_and_output():
    """Two that rub and one that does not, with a sensor on the structure."""
    rubs = {"friction": {"coefficient": 0.2}, "arm": {"stiffness": 2e6, "rotation": float("inf")}}
    back = {"name": "back", "on": "plate:-z", "at": [0.02, -0.01], "count": 2, **SPHERES,
            "striker": {"velocity": 0.1}, "friction": {"coefficient": 0.05}}  # fmt: skip
    sensor = {"on": "plate:+y", "radius": 2e-3, "direction": "normal", "quantity": "velocity"}
    run = beadwave.impact(
        PLATE | {"chains": [TOP | rubs, END | {"output": {"spheres": [1, 3]}}, back]},
        {"output.sensors": [sensor]},
    )
    of = run.summary.chains
    assert of["end"].friction is None and set(of["end"].waves) == {"1", "3"}
    assert set(of["top"].waves) == {"2"}
    a = run.arrays
    assert a["rubbing"].tolist() == [0, 2]
    assert a["friction_force"].shape == (401, 2, 2) and a["wall_x"].shape == (401, 3)
    # Coulomb's bound, the contact's force with its damper left out
    for i, (last, mu) in enumerate(((3, 0.2), (8, 0.05))):
        size = np.hypot(*a["friction_force"][:, i].T)
        assert (size <= mu * a["contact_force"][:, last] * (1 + 1e-9) + 1e-12).all()
        assert size.max() > 1e-3
    assert not a["sphere_spin"][:, 0].any() and a["sphere_spin"][:, 1].any()
    assert run.summary.energy_error < 1e-6


def test_weight_across_all_chains_and_chains_that_nothing_presses_are_told():
    far = {"striker": {"velocity": 0.01, "time": 3e-4}}
    run = beadwave.impact(
        PLATE | {"chains": [TOP | far], "gravity": {"direction": [1, 0, 0]}},
        {"time.duration": 3.2e-4, "reduction.error": 1e-2},
    )
    told = " ".join(run.summary.warnings)
    assert "chains.top: Nothing presses on the structure within time.duration = 0.00032 s" in told
    assert "[gravity] acts across all chains" in told


def test_chains_at_one_place_are_refused_before_the_mesh():
    with pytest.raises(InvalidScene, match=r"chains.top and chains.end overlap by 0.0113 m"):
        beadwave.scene(TWO | {"chains": [TOP, TOP | {"name": "end", "at": [0.0106, 0.0004]}]})


@pytest.mark.slow
def test_a_run_leaves_a_page_that_moves_structure_and_chains(tmp_path, own_folder):
    run = beadwave.run(TWO, out=tmp_path / "run")
    names = {path.name for path in (tmp_path / "run" / "figures").iterdir()}
    assert {"forces.png", "waves.png", "energies.png", "assembly.png"} <= names
    data = page_data(tmp_path / "run", run.summary)
    x = unpacked(data["chain"]["x"])
    assert x.shape[1] == 7 and "q" in data["assembly"]
    assert len(data["chain"]["rest"]) == 21 and len(data["chain"]["along"]) == 21
    np.testing.assert_allclose(data["chain"]["rest"][9:12], [0.0, 0.0, 6e-3], atol=1e-9)
    assert {c["name"] for c in data["curves"]["plots"]["force"]} == {"top", "end"}
    again = beadwave.scene(tmp_path / "run" / "scene.toml")
    assert again.chains == run.scene.chains and again.strike == run.scene.strike
    text = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "2 chains lean on one assembly" in text


def test_a_sweep_over_delays_and_places_has_the_numbers_of_runs(struck, tmp_path):
    """A row for each case: waves and force of both chains as a run of it has them."""
    over = {"chains.end.striker.time": ["30us", "80us"], "chains.top.at": [[0.01, 0.0], [0.4, 0.0]]}
    found = beadwave.sweep(TWO, over=over, out=tmp_path / "swept")
    rows = found.data()
    assert rows["status"].tolist() == ["done", "failed", "done", "failed"]
    assert "chains.top" in rows["message"].iloc[1] and "leaves that face" in rows["message"].iloc[1]
    for case, run in ((0, struck), (2, beadwave.impact(TWO, {"chains.end.striker.time": "80 us"}))):
        row = rows.iloc[case]
        for name, chain in run.summary.chains.items():
            assert row[f"{name}_wall_peak_force_N"] == pytest.approx(chain.peak_wall_force_N)
            incident = chain.waves["2"].arrivals[0]
            assert row[f"{name}_sphere_2_incident_s"] == pytest.approx(incident.time_s, rel=1e-6)
        assert row["wall_peak_force_N"] == pytest.approx(run.summary.peak_wall_force_N)
        assert row["error_time"] == pytest.approx(run.summary.error_estimate.time)
        for cause in ("reduction", "mesh"):
            stated = getattr(run.summary.error_estimate, cause)
            assert row[f"error_{cause}"] == pytest.approx(stated, rel=1e-6)
    assert {"top_wall_peak_force_N", "end_wall_peak_force_N"} <= set(found.main)
    assert found.units == {"chains.end.striker.time": "s", "chains.top.at": "m"}
    with pytest.raises(InvalidScene, match=r"--signals are of one \[chain\]"):
        beadwave.sweep(TWO, over=over, out=tmp_path / "kept", signals=True)


def test_the_error_of_the_mesh_is_above_the_true_one(struck):
    """Beside a mesh of elements a third as large, within a factor of ten; of each chain its own."""
    fine = beadwave.impact(TWO, {"mesh.scale": 1.0})
    change = np.abs(fine.arrays["v"] - struck.arrays["v"]).max(axis=0) / 0.3
    stated = struck.summary.error_estimate.mesh
    assert change.max() < stated < 10.0 * change.max()
    assert fine.summary.error_estimate.mesh < 0.5 * stated
    of_chains = [chain.errors.mesh for chain in struck.summary.chains.values()]
    assert max(of_chains) == stated
    assert change[:4].max() < of_chains[0] and change[4:].max() < of_chains[1]


def test_loss_factors_leave_the_error_of_the_mesh_unknown(struck):
    run = beadwave.impact(TWO | {"damping": {"kind": "loss", "materials": {"steel": 0.01}}})
    assert run.summary.error_estimate.mesh is None
    assert any("The error of the mesh could not be estimated" in w for w in run.summary.warnings)


SENSED = [
    {"sphere": 2, "chain": "top"},
    {"sphere": 1, "chain": "end", "quantity": "velocity", "gain": 2.0},
    {"on": "plate:+y", "quantity": "displacement", "direction": "z", "low_pass": 1e7},
]


def test_sensors_show_the_chains_that_they_name_and_the_structure_under_both(tmp_path):
    """Spheres as the trajectory has them; a face as all modes of the mesh move it under both
    forces, to 2e-3."""
    scene = PLATE | {"chains": [TOP, END]}
    scene["output"] = {**PLATE["output"], "sensors": SENSED, "samples": 1601}
    run = beadwave.impact(scene, out=tmp_path / "run")
    assert set(run.summary.sensors) == {
        "force top 2", "velocity end 1", "displacement plate:+y z"
    }  # fmt: skip
    lines = (tmp_path / "run" / "signals.csv").read_text(encoding="utf-8").splitlines()
    assert "top sphere 2 force [N]" in lines[1] and "end sphere 1 velocity [V]" in lines[1]
    t, force, velocity, moved = np.loadtxt(lines[2:], delimiter=",").T
    a = run.arrays
    F, v = a["contact_force"], a["v"]
    at = [np.interp(t, a["t"], x) for x in (0.5 * (F[:, 0] + F[:, 1]), 2.0 * v[:, 4])]
    np.testing.assert_allclose(force, at[0], atol=0.02 * at[0].max())
    np.testing.assert_allclose(velocity, at[1], atol=0.02 * at[1].max())

    # all modes under both forces, each taken linear between fine instants
    pipeline = pipeline_of(run.scene, quiet)
    model, contacts = pipeline("model"), pipeline("chain-contacts")
    square, shapes = eigh(model.K.toarray(), model.M.toarray())
    place = sensor_places(run.scene)[0]
    sense = shapes.T @ functional(run.scene, model, bodies_of_faces(model), place)
    omega, phi, zeta = np.sqrt(square), shapes.T @ contacts.w, 0.005
    fine = np.linspace(0.0, a["t"][-1], 16 * 1600 + 1)
    pushes = CubicSpline(a["t"], F[:, [3, 6]])(fine) @ phi.T
    h, swing = fine[1], omega * np.sqrt(1 - zeta**2)
    decay, c, s = np.exp(-zeta * omega * h), np.cos(swing * h), np.sin(swing * h)
    q, p, shown = np.zeros(len(omega)), np.zeros(len(omega)), [0.0]
    for f in 0.5 * (pushes[1:] + pushes[:-1]):
        rest = f / square
        x, y = q - rest, (p + zeta * omega * (q - rest)) / swing
        q, p = (
            rest + decay * (x * c + y * s),
            decay * ((y * swing - zeta * omega * x) * c - (x * swing + zeta * omega * y) * s),
        )
        shown.append(float(sense @ q))
    expected = np.interp(t, fine, shown)
    np.testing.assert_allclose(moved, expected, atol=2e-3 * np.abs(expected).max())


def test_the_command_prints_each_chain(capsys, tmp_path, own_folder):
    (tmp_path / "two.toml").write_text(
        'chains = [{ name = "only", on = "plate:+z", count = 2, radius = "6 mm", '
        'material = "steel", striker = { velocity = 0.2 } }]\n'
        'assembly = { held = ["plate:-x"], material = "steel" }\n'
        "bodies = { plate = { box = [0.06, 0.04, 0.01] } }\nmesh = { scale = 4.0 }\n"
        "time = { duration = 1e-4 }\noutput = { samples = 101 }\n"
    )
    assert command("impact", str(tmp_path / "two.toml"), "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["chains"]["only"]["peak_wall_force_N"] > 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wall": {"kind": "rigid"}}, r"\[wall\] is not of \[\[chains\]\]"),
        ({"shakers": [SHAKER]}, "nothing presses the last sphere of chains.top on the structure"),
        ({"shakers": [SHAKER], "preload": {"force": 10.0}},
         'sphere 2 of top is held by nothing .* or with friction set its upstream'),
        ({"shakers": [SHAKER | {"on": "wall"}], "preload": {"force": 10.0}},
         'shakers.motor.on = "wall" is no face of a structure'),
        ({"shakers": [SHAKER | {"force": None, "velocity": 1e-3}], "preload": {"force": 10.0}},
         "shakers.motor moves a structure without a stinger"),
        ({"shakers": [SHAKER, SHAKER | {"name": "b", "frequency": 707.1}],
          "preload": {"force": 10.0}}, "have no common period"),
        ({"shakers": [SHAKER], "preload": {"force": 10.0},
          "output": {"sensors": [{"on": "plate:+y", "quantity": "velocity"}]}},
         "output.sensors on the structure are not computed"),
        ({"shakers": [SHAKER], "preload": {"force": 10.0},
          "contact": {"law": "thornton", "yield_pressure": 1e9}}, "has no periodic state"),
        ({"shakers": [SHAKER], "gravity": {"direction": [0, 0, -1]},
          "chains": [END | {"count": 1, "output": {"spheres": [1]}}], "output": {"samples": 101}},
         "nothing presses the last sphere of end"),
        ({"shakers": [SHAKER | {"on": "plate:-x"}], "preload": {"force": 10.0}},
         "shakers.motor: 'plate:-x' is held fast in that direction"),
        ({"friction": {"coefficient": 0.1, "upstream": "held"}},
         r"friction.upstream is of chains below which shakers move; add \[\[shakers\]\]"),
        ({"chains": [TOP | {"count": 200_000}, TOP | {"name": "end", "count": 200_000,
                                                       "at": [0.011, 0.0]}]}, "GB of memory"),
        ({"arm": {}}, r"chains.top: \[arm\] holds the last sphere against friction"),
        ({"chains": [TOP | {"friction": {"coefficient": 0.1}, "contact": {
            "law": "thornton", "yield_pressure": 1e9}}]}, 'top: .friction. with contact.law = "th'),
        ({"friction": {"coefficient": 0.1}, "gravity": {"direction": [1, 0, -1]}},
         "gravity weighs 6.93 m/s.2 across chains.top"),
        ({"contact": {"law": "power", "exponent": 2, "stiffness": 1e9}},
         'contact.law = "power" is not of .*take "hertz" or "thornton"'),
        ({"contact": {"law": "thornton", "yield_pressure": 1e4}}, "a millionth of the spheres"),
        ({"chains": [TOP | {"output": {"spheres": [5]}}]}, "chains.top.output.spheres has 5"),
        ({"reduction": {"modes": 30}}, "reduced to one error at all contacts together"),
        ({"chains": [TOP, TOP]}, "chains has 2 tables named 'top'"),
        ({"chains": [TOP | {"striker": None}]}, "nothing moves"),
        ({"chains": [TOP | {"initial_velocity": [1.0]}]}, "has 1 values, 4 are allowed"),
        ({"chains": [TOP | {"at": [0.039, 0.0]}]}, "leaves that face; move it by chains.top.at"),
        ({"chains": [TOP, END | {"on": "plate:+z", "at": [0.02, 0.0]}]}, "overlap by 0.002 m"),
        ({"chains": [TOP | {"on": "lid:+z"}]}, "lid"),
        (DRUM | {"chains": [TOP | {"on": "drum:cylinder"}]}, "chains.top.on = .* no plane face"),
        ({"chains": [TOP | {"on": "plate"}]}, "chains.top.on: 'plate' is no face of a body"),
        (DRUM | {"chains": [TOP | {"on": "drum:cylinder", "at": [0, 0, 0]}]},
         r"chains.top: \[0.0, 0.0, 0.0\] m lies in the middle"),
        ({"gravity": {"inclination": 80}}, "give gravity.direction"),
        ({"gravity": {"direction": [0, 0, 1]}}, "top: a weight of .* pulls the spheres"),
        ({"gravity": {"direction": [0, 0, 0]}}, "none: give x, y, z"),
        ({"gravity": {}, "assembly": {"held": [], "material": "steel"}}, "without supports"),
        ({"chains": [TOP | {"leaf_springs": {"stiffness": 1e3},
                            "striker": {"velocity": 0.1, "time": 1e-4}}]}, "the first stiffness 0"),
        ({"chains": [TOP | {"striker": {"velocity": 0.1, "time": 4e-4}}]}, "not before the end"),
        ({"gravity": {"acceleration": 30}, "chains": [
            TOP | {"striker": {"velocity": 1e-3, "time": 1e-4}}]}, "gains 0.003 m/s by its weight"),
        (DRUM | {"chains": [TOP | {"on": "drum:cylinder", "at": [20, 0, 0]}]}, "20 m away"),
        (DRUM | {"chains": [TOP | {"on": "drum@0.02,0,0", "at": [7, 7]}]}, "is along a plane face"),
        ({"output": {"sensors": [{"sphere": 1}]}}, "chain is missing, allowed are top, end"),
        ({"output": {"sensors": [{"sphere": 4, "chain": "end"}]}}, "1 to chains.end.count = 3"),
        ({"strike": {"on": "plate:+z"}}, r"\[strike\] is of one \[chain\]"),
        ({"output": {"spheres": [5]}}, "the longest of"),
        ({"assembly": {"parts": ["block"]}, "bodies": None}, "the thesis' rig"),
    ],
)  # fmt: skip
def test_what_is_not_of_several_chains_is_refused_in_a_sentence(changes, words):
    tables = {name: table for name, table in (TWO | changes).items() if table is not None}
    with pytest.raises(InvalidScene, match=words):
        beadwave.impact(tables)


@pytest.mark.slow
def test_shakers_move_the_structure_below_all_chains():
    """Each chain's contact goes round in a cycle before its striker comes; the summary has its
    numbers, the run begins with it, and what shakers do and what is lost balance."""
    rubbing = {
        "shakers": [SHAKER], "preload": {"force": 10.0}, "arm": {
            "stiffness": 1e6}, "friction": {"coefficient": 0.2, "upstream": "held"},
        "time": {"duration": 4e-4, "error": 1e-4},
    }  # fmt: skip
    run = beadwave.impact(TWO | rubbing)
    a, scene = run.arrays, pipeline_of(run.scene, quiet)
    state = scene("chains-before")
    assert state.change < 1e-4 and state.n_periods == 1
    lost = state.saved.energy[-1] - state.saved.energy[0]
    # modes swing with 140 times the energy that a period takes: 3e-5 of that
    assert state.unbalanced < 1e-2 * lost[-2]
    for i, (name, last) in enumerate((("top", 3), ("end", 6))):
        numbers = run.summary.chains[name].friction
        largest = 0.5 * np.ptp(state.saved.friction[:, i], axis=0).max()
        assert numbers.loop_tangential_N == pytest.approx(largest, rel=5e-3)  # between instants
        assert numbers.loop_periods == 1 and numbers.state_at_impact in ("stick", "partial slip")
        assert a["v"][0, last] != 0.0
        np.testing.assert_allclose(a["cycle_friction_force"][:, i], state.saved.friction[:, i])
    assert run.summary.chains["top"].errors.time <= 1e-4 and run.summary.energy_error < 1e-4
    assert a["cycle_t"][[0, -1]].tolist() == [-2e-3, 0.0]
    assert np.ptp(a["energy_total"]) < 1e-4 * a["energy_kinetic"].max()
    assert 0.0 < run.summary.chains["top"].errors.reduction < 0.05


@pytest.mark.slow
def test_cases_of_a_sweep_begin_with_the_cycle_of_their_own_shakers(tmp_path, capsys):
    """A case has the force of a run of its own; one without a periodic state is told."""
    parquet = pytest.importorskip("pyarrow.parquet")
    shaken = {
        "shakers": [SHAKER], "preload": {"force": 10.0}, "arm": {"stiffness": 1e6},
        "friction": {"coefficient": 0.2, "upstream": "held"},
        "time": {"duration": 4e-4, "error": 1e-4},
    }  # fmt: skip
    alone = beadwave.impact(TWO | shaken).summary.peak_wall_force_N
    (tmp_path / "shaken.toml").write_text(toml(beadwave.scene(TWO | shaken)))
    over = "--over=shakers.motor.force=20,4000"
    assert command("sweep", str(tmp_path / "shaken.toml"), over, f"--out={tmp_path}/s") == 0
    cases = parquet.read_table(tmp_path / "s" / "cases.parquet").to_pydict()
    assert cases["wall_peak_force_N"][0] == pytest.approx(alone, rel=1e-4)
    assert cases["status"] == ["done", "failed"]
    assert "[[shakers]]: the s" in cases["message"][1]


@pytest.mark.slow
def test_a_stinger_holds_the_structure_of_several_chains():
    """Its stiffness is in the modes, its motion a force on them: next to the full model."""
    sprung = {"leaf_springs": {"stiffness": (0.0, 1e5, 1e5, 1e5)}}
    push = SHAKER | {"force": None, "displacement": 1e-6, "stinger": 1e6}
    scene = PLATE | {"chains": [TOP | sprung], "shakers": [push], "preload": {"force": 10.0}}
    steps = pipeline_of(beadwave.scene(scene), quiet)
    behind, model = steps("structure"), steps("model")
    place = functional(steps.scene, model, bodies_of_faces(model), shaker_places(steps.scene)[0])
    K = model.K.toarray() + 1e6 * np.outer(place, place)
    squares = eigh(K, model.M.toarray(), eigvals_only=True, subset_by_index=(0, 1))
    np.testing.assert_allclose(np.sort(behind.omega)[:2], np.sqrt(squares), rtol=1e-3)
    assert behind.shakers.force == pytest.approx(1.0)
