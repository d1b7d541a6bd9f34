"""A crystal's scene from its tables to its files, and what is refused on the way."""

import json

import numpy as np
import pytest

import beadwave
from beadwave import InvalidScene
from beadwave.workflows.report.packing import unpacked
from beadwave.workflows.report.page_data import PageLimits, page_data
from beadwave.workflows.report.summary import Summary

from command_line import beadwave as command

SMALL = {
    "crystal": {
        "lattice": "hexagonal", "size": [4, 5], "radius": 6e-3, "material": "steel",
        "striker": {"at": [1, 0], "velocity": 0.3},
    },
    "wall": {"kind": "rigid"},
    "time": {"duration": 2e-4},
    "output": {"samples": 101},
}  # fmt: skip
NODES = """sphere, x [m], y [m], z [m], radius [m], guide_x, guide_y, guide_z
7, 0.000, 0, 0, 0.006, 1, 0, 0
8, 0.012, 0, 0, 0.006, 1, 0, 0
9, 0.024, 0, 0, 0.006, 1, 0, 0
"""
LINKS = "first, second\n7, 8\n9, 8\n"


PERIODIC = {
    "crystal.sides": "periodic", "crystal.size": [4, 6], "crystal.striker.at": [1, 0]
}  # fmt: skip


@pytest.fixture
def network(tmp_path):
    """The tables of a network of three spheres in a row, whose files can be written anew."""
    (tmp_path / "nodes.csv").write_text(NODES)
    (tmp_path / "links.csv").write_text(LINKS)
    crystal = {
        "nodes": str(tmp_path / "nodes.csv"), "links": str(tmp_path / "links.csv"),
        "material": "steel", "striker": {"at": [7], "velocity": 0.3},
    }  # fmt: skip
    return {"crystal": crystal, "time": {"duration": 1e-4}, "output": {"samples": 51}}


def test_a_run_leaves_arrays_arrivals_pictures_and_a_page(tmp_path, own_folder):
    run = beadwave.run(SMALL, out=tmp_path / "run")
    a = run.arrays
    k, s, c = 101, 20, len(a["pairs"])
    shapes = {
        "rest": (s, 3), "displacement": (k, s, 3), "velocity": (k, s, 3), "saved": (s,),
        "pairs": (c, 2), "pair_force": (k, c), "error_displacement": (s,), "error_velocity": (s,),
        "error_pair_force": (c,),
    }  # fmt: skip
    assert {name: a[name].shape for name in shapes} == shapes
    assert run.summary.crystal.n_spheres == s and run.summary.crystal.n_contacts == c

    # contacts touch, and forces are those of the stated rows
    inner = a["pairs"][:, 1] >= 0
    i, j = a["pairs"][inner].T
    np.testing.assert_allclose(np.linalg.norm(a["rest"][j] - a["rest"][i], axis=1), 0.012)
    assert (a["pairs"][~inner, 1] == -1).all() and (~inner).sum() == 4
    momentum = run.scene.crystal.density * 4 / 3 * np.pi * 0.006**3 * a["velocity"].sum(axis=1)
    pushed = np.trapezoid(a["pair_force"][:, ~inner].sum(axis=1), a["t"])
    assert momentum[0, 1] - momentum[-1, 1] == pytest.approx(pushed, rel=1e-3)

    lines = (tmp_path / "run" / "arrivals.csv").read_text().splitlines()
    assert lines[0] == "sphere,x,y,z,arrival_s,peak_velocity_m_s,error" and len(lines) == s + 1
    struck = lines[2].split(",")
    assert struck[0] == "2" and float(struck[5]) == 0.3 and 0.0 < float(struck[6]) < 3e-5
    page = (tmp_path / "run" / "report.html").read_text()
    assert "hexagonal packing of 20 spheres" in page and page.count("data:image/png") == 4
    peak = run.summary.crystal.peak_structure_force_N
    assert peak == pytest.approx(a["pair_force"][:, ~inner].sum(axis=1).max(), rel=1e-12)


def test_the_summary_is_printed_as_json(capsys):
    assert command("impact", "y-chain", "--json", "--set", "time.duration=2e-4") == 0
    crystal = json.loads(capsys.readouterr().out)["crystal"]
    assert crystal["n_spheres"] == 36 and crystal["n_contacts"] == 35
    assert crystal["front_speed_m_s"]["x"] is None
    assert crystal["front_speed_m_s"]["y"] == pytest.approx(534, rel=0.02)


def test_output_spheres_are_saved_alone():
    run = beadwave.impact(SMALL, {"output.spheres": [2, 6, 7]})
    assert run.arrays["saved"].tolist() == [2, 6, 7]
    whole = beadwave.impact(SMALL)
    np.testing.assert_array_equal(run.arrays["velocity"], whole.arrays["velocity"][:, [1, 5, 6]])


def test_spheres_that_are_missing_keep_the_numbers_of_the_others():
    run = beadwave.impact(SMALL, {"crystal.missing": [[0, 0], [2, 1]]})
    assert run.arrays["saved"].tolist() == [n for n in range(1, 21) if n not in (1, 7)]
    assert run.arrays["velocity"][0, 0, 1] == 0.3  # the struck one is the second place


def test_an_inclusion_of_less_mass_moves_faster_than_its_neighbours():
    soft = {"at": [1, 2], "material": "ptfe"}
    run = beadwave.impact(SMALL, {"crystal.inclusions": [soft]})
    assert run.summary.crystal.n_contacts == 43 + 4
    plain = beadwave.impact(SMALL).arrays["pair_force"].max()
    assert run.arrays["pair_force"].max() == pytest.approx(plain, rel=1e-3)  # the first contacts
    touched = (run.arrays["pairs"] == 9).any(axis=1)
    # E* of ptfe and steel is 1/60 of steel's
    assert run.arrays["pair_force"][:, touched].max() < 0.2 * plain


def test_scattered_radii_leave_gaps_and_no_overlap():
    first, again, other = (
        beadwave.impact(SMALL, {"crystal.scatter": 1e-3, "crystal.seed": seed}).arrays
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first["radius"], again["radius"])
    assert np.any(first["radius"] != other["radius"])
    inner = first["pairs"][:, 1] >= 0
    i, j = first["pairs"][inner].T
    apart = np.linalg.norm(first["rest"][j] - first["rest"][i], axis=1)
    gap = apart - first["radius"][i] - first["radius"][j]
    assert gap.min() == pytest.approx(0.0, abs=1e-12) and gap.max() > 1e-6


def test_a_sprung_wall_moves_and_its_energy_is_in_the_ledger():
    sprung = {"kind": "1dof", "frequency": 2e3, "mass": 0.05, "damping_ratio": 0.05}
    long = {"wall": sprung, "time.duration": 4e-4}
    run = beadwave.impact(SMALL, long)
    a = run.arrays
    assert a["wall_x"].max() > 1e-7 and a["energy_wall"].max() > 0.0
    assert a["dissipated_wall"][-1] > 0.0
    assert run.summary.energy_error < 1e-6


def test_a_network_of_files_is_the_row_that_it_draws(network):
    run = beadwave.impact(network)
    chain = {"count": 3, "radius": 6e-3, "material": "steel"}
    row = beadwave.impact(
        {
            "chain": chain,
            "striker": {"velocity": 0.3},
            **{k: network[k] for k in ("time", "output")},
        }
    )
    assert run.arrays["saved"].tolist() == [7, 8, 9]
    np.testing.assert_allclose(run.arrays["velocity"][:, :, 0], row.arrays["v"], atol=1e-5)


@pytest.mark.parametrize(
    ("file", "text", "sentence"),
    [
        ("nodes", NODES.replace("0.006, 1", "-0.006, 1"), "radius of sphere 7"),
        ("nodes", NODES.replace("8, 0.012", "7, 0.012"), "whole number of its own"),
        ("nodes", NODES.replace("guide_z", "guide"), "they must be sphere, x, y, z"),
        ("nodes", NODES.replace("0.012", "0.013"), "0.001 m apart"),
        ("nodes", "nothing", "crystal.nodes"),
        ("links", LINKS + "7, 12\n", "names the sphere 12"),
        ("links", LINKS + "8, 7\n", "7 and 8 twice"),
    ],
)
def test_files_of_a_network_that_are_wrong_are_refused(file, text, sentence, network, tmp_path):
    (tmp_path / f"{file}.csv").write_text(text)
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.impact(network)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"crystal.size": [4]}, "at least 2"),
        ({"crystal.size": [4, 4, 4]}, "must be 2 numbers"),
        ({"crystal.lattice": "fcc"}, "must be 3 numbers"),
        ({"crystal.lattice": "kagome"}, "must be"),
        ({"crystal.striker": {"velocity": 0.3}}, "one of at, row and plane"),
        ({"crystal.striker": {"plane": 0, "velocity": 0.3}}, "give row"),
        ({"crystal.striker": {"row": 5, "velocity": 0.3}}, "below 5"),
        ({"crystal.striker.at": [4, 0]}, "no place of a lattice of 4 x 5"),
        ({"crystal.missing": [[1, 0]]}, "has no sphere"),
        ({"crystal.missing": [[1, 9]]}, "no place"),
        ({"crystal.inclusions": [{"at": [1, 1], "radius": 7e-3}]}, "presses its neighbours"),
        ({"crystal.half_angle": 45.0}, 'lattice = "y" belong together'),
        ({"crystal.nodes": "nodes.csv"}, "belong together"),
        ({"crystal.precompression": "1 um"}, 'sides = "periodic" or "rigid"'),
        (
            {"crystal": {**SMALL["crystal"], "precompression": 1e-6, "force": 10.0}},
            "exclude each other",
        ),
        ({"gravity": {"inclination": 90.0}}, "presses a hexagonal packing apart"),
        ({"gravity": {"inclination": -10.0}}, "take an angle above 0"),
        ({"friction": {"coefficient": 0.2, "upstream": "held"}}, "friction.upstream is of a"),
        ({"chain": {"count": 3, "radius": 6e-3, "material": "steel"}}, "is of a chain"),
        ({"wall": {"kind": "dashpot", "coefficient": 300.0}}, "not behind a"),
        (
            {"contact.law": "power", "contact.stiffness": 1e9, "contact.exponent": 2.0},
            "hertz or thornton",
        ),
        ({"output.sensors": [{"sphere": 1, "quantity": "velocity"}]}, "drop them"),
        ({"output.spheres": [21]}, "allowed are 1 to 20"),
        ({"crystal.size": [1000, 1000]}, "allowed are 200000"),
        ({"output.samples": 1000000, "crystal.size": [100, 100]}, "list spheres"),
        (
            {"time.duration": 1.0, "crystal.size": [300, 300], "output.samples": 3},
            "at least, allowed",
        ),
    ],
)
def test_a_crystal_that_cannot_be_is_refused_in_a_sentence(changes, sentence):
    with pytest.raises(InvalidScene, match=sentence) as refused:
        beadwave.impact(SMALL, changes)
    assert str(refused.value).count("\n") == 0


def test_a_y_of_thirty_degrees_is_refused():
    with pytest.raises(InvalidScene, match="must be above 30"):
        beadwave.impact("y-chain", {"crystal.half_angle": 30.0})


@pytest.mark.parametrize("verb", ["calibrate", "sweep", "inspect"])
def test_verbs_of_chains_say_that_a_crystal_has_none(verb, capsys, tmp_path):
    (tmp_path / "data.csv").write_text("time [s], sphere 1 velocity [m/s]\n0, 0\n1e-6, 0\n")
    arguments = {
        "calibrate": [str(tmp_path / "data.csv")],
        "sweep": ["--over", "crystal.half_angle=40:50:3", "--out", str(tmp_path / "s")],
        "inspect": [str(tmp_path / "data.csv"), "--find", "crystal.half_angle"],
    }
    assert command(verb, "y-chain", *arguments[verb]) == 2
    assert "[chain]" in capsys.readouterr().err


def test_a_pressed_crystal_rests_and_its_band_ends_at_the_closed_form():
    pressed = {**PERIODIC, "crystal.precompression": "1 um", "crystal.striker.velocity": 1e-7}
    run = beadwave.impact(SMALL, pressed)
    a = run.arrays
    inner = (a["pairs"] >= 0).all(axis=1)
    A = 4 / 3 * 210e9 / 2 / (1 - 0.3**2) * np.sqrt(0.003)
    np.testing.assert_allclose(a["pair_force"][0, inner], A * 1e-9, rtol=1e-6)
    k, m = 1.5 * A * 1e-3, 7850 * 4 / 3 * np.pi * 0.006**3
    low, high = run.summary.crystal.band_edges_hz
    assert low == 0.0 and high == pytest.approx(np.sqrt(6 * k / m) / 2 / np.pi, rel=2e-4)
    # next to the striker's 1e-7 m/s the forces at rest leave nothing
    assert np.abs(a["velocity"]).max() < 1.5e-7


def test_a_pressed_lattice_whose_spheres_slip_out_of_all_contacts_is_refused():
    changes = {
        "crystal.lattice": "bcc", "crystal.size": [3, 3, 3], "crystal.sides": "rigid",
        "crystal.precompression": 1e-6, "crystal.striker.at": [1, 1, 2],
    }  # fmt: skip
    with pytest.raises(InvalidScene, match="no state of rest where it is pressed"):
        beadwave.run(SMALL, changes)


def test_a_force_on_the_first_row_arrives_at_the_wall():
    run = beadwave.impact(SMALL, {**PERIODIC, "crystal.force": "10 N"})
    at_wall = run.arrays["pairs"][:, 1] < 0
    assert run.arrays["pair_force"][0, at_wall].sum() == pytest.approx(10.0, rel=1e-9)


def test_modes_of_a_crystal_are_printed_beside_its_bands(capsys, tmp_path):
    options = [f"--set={key}={value}" for key, value in PERIODIC.items()]
    options += ["--set=crystal.precompression=1um", "--json", "--out", str(tmp_path / "modes")]
    assert command("modes", "hexagonal", *options) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["n_still"] == 1 and len(table["rows"]) == 2 * 24 - 1  # it slides along the planes
    top = table["band_edges_hz"][1]
    assert 0.9 * top < table["rows"][-1]["frequency_hz"] < 1.001 * top
    assert [branch["axis"] for branch in table["dispersion"]] == ["x", "y"]
    assert (tmp_path / "modes" / "figures" / "dispersion.png").is_file()
    assert beadwave.modes("hexagonal", {**PERIODIC, "crystal.precompression": 1e-6}).data.mode.size

    assert command("modes", "hexagonal") == 2
    assert "give crystal.precompression" in capsys.readouterr().err


def test_friction_spins_spheres_and_takes_energy():
    run = beadwave.impact(SMALL, {"friction": {"coefficient": 0.2}})
    a = run.arrays
    assert a["angular_velocity"].shape == a["velocity"].shape
    assert a["pair_friction"].shape == (*a["pair_force"].shape, 3)
    assert np.abs(a["angular_velocity"][-1, :, 2]).max() > 0.5
    strength = np.linalg.norm(a["pair_friction"], axis=2)
    assert np.all(strength <= 0.2 * a["pair_force"] * (1 + 1e-12))
    assert 0.0 < a["dissipated_friction"][-1] < 0.5 * a["energy_kinetic"][0]
    assert run.summary.energy_error < 1e-6

    # between spheres none: the wall alone holds them, across the impact
    smooth = beadwave.impact(SMALL, {"friction": {"coefficient": 0.2, "between_spheres": 0.0}})
    inner = smooth.arrays["pairs"][:, 1] >= 0
    assert np.abs(smooth.arrays["pair_friction"][:, inner]).max() == 0.0


def test_the_wall_carries_the_weight_of_a_crystal_at_rest():
    tilted = {**PERIODIC, "gravity": {"inclination": 30.0}, "crystal.striker.velocity": 1e-9}
    run = beadwave.impact(SMALL, tilted)
    a = run.arrays
    mass = 7850 * 4 / 3 * np.pi * 0.006**3 * 24
    at_wall = a["pairs"][:, 1] < 0
    assert a["pair_force"][0, at_wall].sum() == pytest.approx(mass * 9.80665 / 2, rel=1e-6)
    assert np.abs(a["velocity"]).max() < 2e-9


SHAKE = "time [us], displacement [um]\n" + "".join(
    f"{t}, {3 * np.sin(2 * np.pi * t / 200) ** 2:.12g}\n" for t in range(0, 301, 2)
)


def test_a_driven_row_moves_as_its_file_says_and_its_work_is_in_the_ledger(tmp_path):
    (tmp_path / "shake.csv").write_text(SHAKE)
    drive = {"row": 0, "quantity": "displacement", "file": str(tmp_path / "shake.csv")}
    crystal = {key: value for key, value in SMALL["crystal"].items() if key != "striker"}
    run = beadwave.impact({**SMALL, "crystal": {**crystal, "drive": drive}})
    a = run.arrays
    moved = 3e-6 * np.sin(2 * np.pi * a["t"] / 200e-6) ** 2
    np.testing.assert_allclose(a["displacement"][:, :4, 1], np.tile(moved, (4, 1)).T, atol=1e-10)
    assert np.abs(a["displacement"][:, :4, 0]).max() == 0.0
    assert a["work_drive"][-1] > 0.0 and run.summary.energy_error < 1e-6
    assert a["velocity"][:, 12:, 1].max() > 1e-3

    for text, sentence in (
        (SHAKE.replace("[um]", "[N]"), "second column"),
        (SHAKE.replace("\n0, 0\n", "\n"), "ascend from 0"),
        ("time [us], displacement [um]\n0,0\n1,0\n2,0\n3,0\n", "before time.duration"),
    ):
        (tmp_path / "shake.csv").write_text(text)
        with pytest.raises(InvalidScene, match=sentence):
            beadwave.impact({**SMALL, "crystal": {**crystal, "drive": drive}})


def test_the_page_holds_the_motion_of_a_crystal_in_few_bytes(own_folder, tmp_path):
    beadwave.run(SMALL, out=tmp_path / "run")
    summary = Summary.model_validate_json((tmp_path / "run" / "summary.json").read_text())
    whole = page_data(tmp_path / "run", summary)["crystal"]
    few = page_data(tmp_path / "run", summary, PageLimits(motion=4 * 20 * 26))["crystal"]
    assert whole["v"]["shape"] == [101, 20] and few["v"]["shape"] == [26, 20]
    assert few["dt"] == pytest.approx(4 * whole["dt"])

    # 8 bits up to what all but the fastest sphere reaches
    u = beadwave.load(tmp_path / "run").arrays["displacement"]
    shown = whole["u_scale"] * unpacked(whole["u"]).reshape(101, 20, 3)
    reached = np.linalg.norm(u, axis=2).max(axis=0)
    slow = reached <= np.sort(reached)[-2]
    np.testing.assert_allclose(shown[:, slow], u[:, slow], atol=0.51 * whole["u_scale"])


def test_contacts_that_yield_do_so_as_in_a_chain(network):
    yields = {"law": "thornton", "yield_pressure": 1.6e9, "dissipation": "none"}
    network["time"] = {"duration": 1.5e-4}
    network["crystal"]["striker"]["velocity"] = 1.0
    run = beadwave.impact({**network, "contact": yields})
    chain = {"count": 3, "radius": 6e-3, "material": "steel"}
    same = {key: network[key] for key in ("time", "output")}
    row = beadwave.impact({"chain": chain, "striker": {"velocity": 1.0}, "contact": yields, **same})
    np.testing.assert_allclose(run.arrays["velocity"][:, :, 0], row.arrays["v"], atol=2e-4)
    lost = [r.arrays["dissipated_contact"][-1] for r in (run, row)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-3) and lost[0] > 0.0
    assert run.summary.energy_error < 1e-5


def test_data_are_named_by_sphere_contact_and_axis_and_a_film_is_refused(tmp_path, capsys):
    run = beadwave.impact(SMALL, {"crystal.missing": [[0, 0]]}, out=tmp_path / "run")
    data, arrays = run.data, run.arrays
    assert data.velocity.sel(sphere=2, axis="y", time=0.0) == 0.3
    assert data.velocity.attrs["units"] == "m/s" and data.energy_spin.attrs["units"] == "J"
    assert data.sizes["contact"] == arrays["pair_force"].shape[1]
    np.testing.assert_array_equal(data.error_velocity, arrays["error_velocity"])
    assert command("film", str(tmp_path / "run")) == 2
    assert "open its report.html" in capsys.readouterr().err
