"""A wall known by its measured response alone, against the wall that it was computed from."""

import numpy as np
import pytest

import beadwave
from beadwave import dem, rom
from beadwave.coupling.measured_wall import measured_wall
from beadwave.workflows.files.receptance_file import driving_point, fitted
from beadwave.workflows.files.response_files import Responses, data_set, write_csv
from beadwave.workflows.scene import InvalidScene, MeasuredWall
from beadwave.workflows.stages.chain.chain import start

HZ = np.arange(25.0, 12800.0, 12.5)
TRUE = rom.ModalFit(
    2 * np.pi * np.array([269.0, 907.0, 2400.0, 5200.0, 8425.0]),
    np.array([0.01, 0.008, 0.01, 0.01, 0.012]), np.sqrt([[0.1, 0.3, 0.25, 0.4, 0.5]]),
    np.zeros((1, 0)), np.array([[4e-10]]),
)  # fmt: skip
H_TRUE = rom.modal_receptance(TRUE, HZ)[:, 0, 0]


def file_of(path, H, hz=HZ):
    write_csv(path, Responses(hz, np.atleast_2d(H), "SYNTHETIC: computed, not measured"))
    return path


def noisy(H, share, seed):
    e = np.random.default_rng(seed).standard_normal((2, *H.shape)) / np.sqrt(2)
    return H * (1 + share * (e[0] + 1j * e[1]))


def scene_of(path, **keys):
    tables = {**beadwave.scene("rig-1dof").model_dump(exclude_none=True)}
    tables["wall"] = {"kind": "measured", "receptance": str(path), "unit": "m/N"} | keys
    tables["time"] = {"duration": 2e-3, "error": 1e-4}
    return tables


def true_error(result, wall):
    """Largest velocity difference of the observed spheres to a march at the known wall, over the
    striker's speed."""
    t, at = result.data["time"].values, [sphere - 1 for sphere in result.scene.output.spheres]
    first = start(result.scene)
    march = {"duration": float(t[-1]), "dt": result.summary.dt_s, "n_save": len(t) - 1}
    run = dem.march(first.chain, wall, first.velocity, **march)
    v = result.data["v"].values
    return np.abs(run.v[:, at] - v[:, at]).max() / np.abs(first.velocity).max()


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_response_with_noise_of_1_per_cent_gives_its_waves_back_within_the_stated_error(
    tmp_path, seed
):
    """Noise of other seeds stands for the noise of the file: twice the mean change of three fits is
    below the true error in a few of a hundred files."""
    path = file_of(tmp_path / "wall.csv", noisy(H_TRUE, 0.01, seed))
    result = beadwave.impact(scene_of(path))
    stated = result.summary.error_estimate
    error = true_error(
        result, dem.Wall(TRUE.omega, TRUE.zeta, TRUE.phi[0], float(TRUE.compliance[0, 0]))
    )
    assert error < stated.receptance + stated.time
    assert stated.receptance < 5e-3  # and means something: 0.3 and 0.7 per mille
    # the ledger closes to rounding of the march, no power comes from the wall
    assert result.summary.energy_error < 1e-5
    assert not result.summary.warnings


@pytest.mark.parametrize(("unit", "order", "factor"), [("mm/s/N", 1, 1e3), ("g/N", 2, 1 / 9.80665)])
def test_mobility_and_accelerance_are_the_receptance_times_i_omega(tmp_path, unit, order, factor):
    """To the six digits of the file; a resonance of width zeta magnifies these by 1 / zeta."""
    H = H_TRUE * (2j * np.pi * HZ) ** order * factor
    table = scene_of(file_of(tmp_path / "wall.csv", H), unit=unit)["wall"]
    _, receptance = driving_point(MeasuredWall(**table))
    assert np.abs(receptance / H_TRUE - 1).max() < 1e-5


def test_what_a_half_space_moves_at_the_sensor_is_taken_out(tmp_path):
    path = file_of(tmp_path / "wall.csv", H_TRUE)
    at = MeasuredWall(**scene_of(path, sensor_distance=0.01)["wall"])
    fits = fitted(at)
    assert fits.half_space == pytest.approx(0.91 / (np.pi * 210e9 * 0.01), rel=1e-12)
    wall = measured_wall(fits.fit, half_space=fits.half_space)
    assert wall.residual_compliance == fits.fit.compliance[0, 0] - fits.half_space


def test_a_band_that_ends_below_the_pulse_is_said(tmp_path):
    hz = HZ[HZ < 1500]
    path = file_of(tmp_path / "wall.csv", rom.modal_receptance(TRUE, hz)[:, 0, 0], hz)
    result = beadwave.impact(scene_of(path))
    assert any("ends at 1488 Hz" in warning for warning in result.summary.warnings)


def test_a_universal_file_is_read_at_its_driving_point_whichever_way_it_was_hit(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    H = H_TRUE
    file = pyuff.UFF(str(tmp_path / "wall.uff"))
    for i, (node, h) in enumerate([(3, 0.5 * H), (7, -H)]):
        content = data_set(Responses(HZ, np.array([h]), "x"), 1)
        content |= {"rsp_node": node, "rsp_dir": 3, "ref_node": 7, "ref_dir": -3}
        file.write_sets(pyuff.prepare_58(binary=0, **content), mode="add" if i else "overwrite")
    wall = MeasuredWall(**scene_of(tmp_path / "wall.uff")["wall"])
    assert np.abs(driving_point(wall)[1] / H - 1).max() < 1e-5
    with pytest.raises(InvalidScene, match="no driving point"):
        driving_point(wall.model_copy(update={"response": 1}))


@pytest.mark.parametrize(("record", "words"), [("noise", "ambient records"), ("tap", "ring-downs")])
def test_records_without_a_force_are_no_response_of_a_wall(tmp_path, record, words):
    """Half of a spectrum is passive like a mobility: one of velocities passes for one in m/s/N."""
    dt, rng = 1e-4, np.random.default_rng(0)
    t = dt * np.arange(8192)
    decay = [np.exp(-0.01 * 2 * np.pi * f * t) * np.sin(2 * np.pi * f * t) for f in (200, 700)]
    push = rng.standard_normal(len(t)) if record == "noise" else np.eye(1, len(t), 50)[0]
    v = np.convolve(push, np.sum(decay, axis=0))[: len(t)]
    path = tmp_path / "record.csv"
    rows = [f"{a:.4f},{b:.6g}" for a, b in zip(t, v, strict=True)]
    path.write_text("\n".join(["time [s], response 1+z [m/s]", *rows, ""]))
    table = scene_of(path, unit="m/s/N")["wall"]
    with pytest.raises(InvalidScene, match=f"has {words} without a force"):
        driving_point(MeasuredWall(**table))


@pytest.mark.parametrize(
    ("change", "keys", "sentence"),
    [
        (lambda H: -H, {}, "gives back .* sign"),
        (lambda H: H, {"unit": "m/s/N"}, "gives back .* unit"),
        (lambda H: np.where(HZ > 5e3, np.nan, H), {}, "line 401 has no number in the column"),
        (lambda H: H, {"response": 2}, "wall.response = 2"),
        (lambda H: np.array([H, H]), {}, "names no response of a point"),
    ],
)
def test_what_is_no_response_of_a_wall_is_refused_in_a_sentence(tmp_path, change, keys, sentence):
    path = file_of(tmp_path / "wall.csv", change(H_TRUE))
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.impact(scene_of(path, **keys))


def test_frequencies_below_zero_are_refused_not_left_out(tmp_path):
    path = file_of(tmp_path / "low.csv", H_TRUE, HZ - HZ[0] - 100.0)
    with pytest.raises(InvalidScene, match="frequencies below 0 Hz, from -100"):
        beadwave.impact(scene_of(path))


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InvalidScene, match=r"wall\.receptance .* does not exist"):
        beadwave.impact(scene_of(tmp_path / "no.uff"))


@pytest.mark.slow
def test_the_receptance_of_the_rig_gives_its_waves_back(tmp_path):
    """Its own file carries the patch's half-space, which wall.half_space takes out."""
    own = beadwave.impact("rig-rom", {"time.duration": 2e-3})
    from beadwave.workflows.stages.engine.cache import memory
    from beadwave.workflows.stages.engine.pipeline import Pipeline

    stages = Pipeline(own.scene, memory())
    reduced, wall = stages("reduction"), stages("wall")
    none = np.zeros((1, 0))
    of_wall = rom.ModalFit(wall.omega, wall.zeta, wall.phi[None], none, np.zeros((1, 1)))
    H = rom.modal_receptance(of_wall, HZ)[:, 0, 0]
    whole = H + wall.residual_compliance + reduced.contact.half_space
    path = file_of(tmp_path / "rig.csv", whole)
    tables = scene_of(path, half_space=reduced.contact.half_space)
    result = beadwave.impact(tables)
    stated = result.summary.error_estimate
    assert true_error(result, wall) < stated.receptance + stated.time
