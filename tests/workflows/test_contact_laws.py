"""Power laws and tables of forces in scenes: files, sweeps and fits."""

import numpy as np
import pytest

import beadwave
from beadwave import dem
from beadwave.dem.kernels.laws import SHAPE_PARAMETERS
from beadwave.workflows.files.force_file import force_table
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.tables.contact import EXPONENTS
from beadwave.workflows.stages.chain.chain import chain, together
from beadwave.workflows.sweep.cases import SIDE_BY_SIDE

POWER = ("contact.law=power", "contact.stiffness=3e12", "contact.exponent=2", "chain.count=6")
SHORT = ("output.spheres=[1, 4]", "time.duration=4e-4")


def test_a_scene_sets_the_force_of_its_contacts(tmp_path):
    row = chain(scene("rig-rigid", (*POWER, "contact.stiffness_factor=1.5", SHORT[0])))
    assert row.elastic.force(np.full(6, 2e-6)) == pytest.approx(1.5 * 3e12 * 4e-12, rel=1e-14)
    path = tmp_path / "force.csv"
    path.write_text("overlap,force\n0,0\n1e-6,4\n\n3e-6,30\n")
    row = chain(scene("rig-rigid", ("contact.law=table", f"contact.file={path}")))
    assert row.elastic.force(np.full(17, 1e-6)) == pytest.approx(4.0, rel=1e-14)


def test_a_scene_takes_the_exponents_that_the_law_takes():
    exponent = SHAPE_PARAMETERS["exponent"]
    assert (exponent.low, exponent.high) == EXPONENTS


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "0 overlaps and 0 forces"),
        ("0,0\n1e-6,1\n2e-6", "'2e-6' in row 3, allowed are two numbers"),
        ("0,0\n1e-6,a\n", "'1e-6,a' in row 2"),
        ("0,0\n1e-6,1\n5e-7,2\n", "must grow from row to row"),
        ("1e-7,0\n1e-6,1\n5e-6,2\n", "start it at 0, 0"),
        ("0,0\n1e-6,inf\n5e-6,2\n", "not a finite number"),
    ],
)
def test_a_file_that_is_no_force_is_refused_with_its_row(text, sentence, tmp_path):
    path = tmp_path / "force.csv"
    path.write_text(text)
    with pytest.raises(InvalidScene, match=r"contact\.file = ") as refused:
        force_table(str(path))
    assert sentence in str(refused.value)


@pytest.mark.slow
def test_the_march_of_a_kept_run_is_anew_when_the_file_of_its_force_changes(tmp_path):
    path, peaks = tmp_path / "force.csv", []
    for factor in (1, 2):
        d = np.linspace(0, 4e-5, 12)
        rows = zip(d, factor * 3e12 * d**2, strict=True)
        path.write_text("".join(f"{a},{b}\n" for a, b in rows))
        run = beadwave.impact(
            "rig-rigid", ("contact.law=table", f"contact.file={path}", POWER[3], *SHORT)
        )  # fmt: skip
        peaks.append(run.summary.peak_wall_force_N)
    # F ~ k^(1/(n+1)) = 2^(1/3) in a wave of the same speed; the table is near that
    assert peaks[1] / peaks[0] == pytest.approx(2 ** (1 / 3), rel=0.01)


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_force_beyond_the_last_row_is_a_warning(share, tmp_path):
    hard, path = 3e12, tmp_path / "force.csv"
    d = np.linspace(0, 4e-5, 12)

    def run():
        path.write_text("".join(f"{a},{hard * a**2}\n" for a in d))
        changes = ("contact.law=table", f"contact.file={path}", POWER[3], *SHORT)
        return beadwave.impact("rig-rigid", changes)

    peak = run().arrays["contact_force"].max()
    d *= np.sqrt(peak / share / hard) / d[-1]  # the last row is at 1 / share of the peak
    sentences = [line for line in run().summary.warnings if "beyond the last row" in line]
    assert len(sentences) == (share > 1.0)
    assert all("of 6 contacts" in line and "contact 6" in line for line in sentences)


@pytest.mark.slow
def test_cases_of_stiffness_and_exponent_march_side_by_side():
    """Each is that case alone, to the error asked for."""
    columns = {"contact.stiffness": [2e12, 3e12], "contact.exponent": [1.9, 2.1]}
    assert SIDE_BY_SIDE >= set(columns)
    base = scene("rig-rigid", (*POWER, *SHORT))
    chains = together(base, {key: np.array(x) for key, x in columns.items()}, None)
    assert chains.fit_lanes
    batch = dem.march_batch(chains, duration=4e-4, error=1e-5, threads=1)
    for i in range(2):
        changes = [f"{key}={values[i]}" for key, values in columns.items()]
        row = chain(scene("rig-rigid", (*POWER, *SHORT, *changes)))
        run = dem.march_to_error(
            row, dem.rigid_wall(), chains.v0[i], duration=4e-4, error=1e-6, n_save=100
        ).trajectory
        assert np.abs(run.v - batch.v[i]).max() < 1.1e-5 * chains.v0.max()


@pytest.mark.slow
def test_stiffness_and_exponent_are_parameters_with_exact_derivatives():
    """By central differences of the rig's own march."""
    from beadwave.dem.sensitivities import march_with_sensitivities, no_directions
    from beadwave.workflows.fit.parameter import directions, rig_at
    from beadwave.workflows.fit.scene_parameters import parameters, rig

    base = scene("rig-rigid", (*POWER, *SHORT))
    start = rig(base, dem.rigid_wall(), 0.0)
    free = parameters(base, ("contact.stiffness", "contact.exponent"), 0.0, {})
    theta = np.array([4e12, 2.04])
    numbers = dict(duration=2e-4, dt=3e-7, observed=[0, 3])

    def march(theta, by=None):
        at = rig_at(start, free, theta)
        by = no_directions(at.chain, at.wall) if by is None else by
        return march_with_sensitivities(at.chain, at.wall, at.v0, by, **numbers)

    exact = march(theta, directions(start, free, theta)).dv
    for j in range(2):
        step = 1e-6 * theta * (np.arange(2) == j)
        difference = (march(theta + step).v - march(theta - step).v) / (2 * step[j])
        assert np.abs(exact[..., j] - difference).max() < 1e-5 * np.abs(difference).max()


@pytest.mark.slow
def test_calibrate_finds_stiffness_and_exponent_of_a_record_within_its_bars(tmp_path):
    true = {"contact.stiffness": 3e12, "contact.exponent": 2.0}
    row = {"contact.law": "power", "chain.count": 9, "time.duration": 8e-4}
    row["output.spheres"] = [2, 5, 8]
    made = beadwave.impact("rig-rigid", row | true).arrays
    t, noise = 1e-6 * np.arange(800), np.random.default_rng(0).normal(0.0, 2e-3, (800, 3))
    v = np.column_stack([np.interp(t, made["t"], made["v"][:, n - 1]) for n in (2, 5, 8)])
    header = "time [s], sphere 2 [m/s], sphere 5 [m/s], sphere 8 [m/s]"
    np.savetxt(tmp_path / "made.csv", np.column_stack([t, v + noise]), "%.9g", ",", header=header,
               comments="")  # fmt: skip
    near = row | {"contact.stiffness": 2.2e12, "contact.exponent": 1.97}
    found = beadwave.calibrate(
        "rig-rigid", tmp_path / "made.csv", near,
        free="contact.stiffness,contact.exponent,trigger", starts=2,
    )  # fmt: skip
    for parameter in found.report.parameters:
        if parameter.name in true:
            assert abs(parameter.found - true[parameter.name]) < 1.5 * parameter.two_sigma
            assert parameter.two_sigma < 0.06 * true[parameter.name]


def test_the_file_of_a_force_is_looked_for_beside_the_scene(tmp_path, monkeypatch):
    (tmp_path / "force.csv").write_text("overlap,force\n0,0\n1e-6,4\n3e-6,30\n")
    (tmp_path / "own.toml").write_text(
        '[chain]\ncount = 3\nradius = 0.01\nmaterial = "steel"\n[striker]\nvelocity = 0.1\n'
        '[contact]\nlaw = "table"\nfile = "force.csv"\n'
    )
    monkeypatch.chdir("/")
    assert scene(tmp_path / "own.toml").contact.file == str(tmp_path / "force.csv")
