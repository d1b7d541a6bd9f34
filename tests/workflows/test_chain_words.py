"""Arrivals, warnings and refusals of chains that are not equal spheres behind a striker."""

from pathlib import Path

import numpy as np
import pytest

import beadwave
from beadwave.dem.waves.arrivals import arrivals, passages

THREE = """
chain = { count = 3, radius = 0.05, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 2.0 }
time = { duration = 2e-3 }
output = { spheres = [1, 2, 3] }
"""


@pytest.fixture
def scene(own_folder):
    """Writes a scene and gives its name."""

    def write(text):
        Path("scene.toml").write_text(text)
        return "scene.toml"

    return write


@pytest.mark.parametrize("duration", [0.5e-3, 0.6e-3, 1.0e-3, 2e-3, 2.1e-3])
@pytest.mark.parametrize("samples", [801, 3001])
def test_a_sphere_that_flies_off_is_reached_when_its_velocity_no_longer_changes(
    scene, duration, samples
):
    """DOP853 at 1e-11: 1.9891 m/s from 0.390 ms on, the last contact opens at 0.399 ms."""
    changes = {"time.duration": duration, "output.samples": samples}
    run = beadwave.impact(scene(THREE), changes)
    (wave,) = run.summary.waves["3"].arrivals
    spacing = duration / (samples - 1)
    assert 0.390e-3 - spacing <= wave.time_s <= 0.399e-3 + spacing
    assert wave.peak_velocity_m_s == pytest.approx(1.9891, abs=1e-4)
    # compiled, for sweeps
    found = passages(run.arrays["t"], run.arrays["v"][:, 2][None])
    assert found[0, :2] == pytest.approx((wave.time_s, wave.peak_velocity_m_s), rel=1e-12)


def test_a_crest_is_no_plateau_however_finely_it_is_sampled():
    t = np.linspace(0.0, 1.0, 100_001)
    v = np.exp(-(((t - 0.4003) / 0.05) ** 2))
    (wave,) = arrivals(t, v)
    assert wave.time == pytest.approx(0.4003, abs=1e-9)
    assert passages(t, v[None])[0, 0] == pytest.approx(0.4003, abs=1e-9)


def test_spheres_that_move_away_from_the_wall_are_not_advised_to_wait(scene):
    away = {"chain.initial_velocity": [-0.3, -0.2, -0.1], "wall": {"kind": "rigid"}}
    tables = beadwave.scene(scene(THREE)).model_dump(exclude_none=True) | {"striker": None}
    tables = {name: table for name, table in tables.items() if table is not None}
    (words,) = beadwave.impact(tables, away).summary.warnings
    assert words == "No sphere moves towards the wall: nothing is measured there."


DIMERS = f"""
[chain]
count = 12
radius = 2.38e-3
density = {6 * [8000.0, 2200.0]}
young = {6 * [193e9, 1.46e9]}
poisson = {6 * [0.3, 0.46]}
[striker]
velocity = 1.4
[wall]
kind = "half-space"
young = 193e9
[time]
duration = 1e-3
[output]
spheres = [7]
"""


def test_waves_of_unlike_spheres_are_peaks_without_names_and_no_shape_is_fitted(scene, monkeypatch):
    fits = []
    monkeypatch.setattr("beadwave.dem.waves.labels.fit", lambda *given: fits.append(given))
    summary = beadwave.impact(scene(DIMERS)).summary
    waves = summary.waves["7"].arrivals
    assert len(waves) >= 2 and all(wave.name is None for wave in waves)
    assert not fits
    (words,) = [words for words in summary.warnings if "masses differ" in words]
    assert "factor of 3.64" in words and "without names" in words


PTFE = """
chain = { count = 10, radius = 2.38e-3, density = 2200.0, young = 1.46e9, poisson = 0.46 }
striker = { velocity = 0.5 }
wall = { kind = "half-space", young = 1.46e9, poisson = 0.46 }
time = { duration = 2e-3 }
output = { spheres = [5] }
"""


@pytest.mark.parametrize("changes", [{}, {"chain.young": 3e9}, {"chain.yield_stress": 10e6}])
def test_warnings_of_polymer_spheres_do_not_speak_of_steel(scene, changes):
    warnings = beadwave.impact(scene(PTFE), changes).summary.warnings
    assert not any("steel" in words for words in warnings)
    (words,) = [words for words in warnings if "pressure" in words]
    stated = "chain.yield_stress" in changes
    assert ("1.6 times 10 MPa" if stated else "1 % of Young's modulus") in words


# a linear pulse on spheres under their weight: the static energies of the ledger are 1e10 of the
# striker's
COLUMN = """
chain = { count = 300, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
gravity = { inclination = 90.0 }
striker = { velocity = 1e-6 }
wall = { kind = "rigid" }
time = { duration = 8e-3, horizon = 0.02 }
output = { samples = 4001 }
"""


def test_a_weak_pulse_is_not_refused_for_the_rounding_of_its_ledger(scene):
    summary = beadwave.impact(scene(COLUMN)).summary
    assert summary.error_estimate.time < 1e-4


# a sphere pressed on a wall of two coupled masses, which a shaker moves along itself
SHAKEN = """
chain = { count = 1, radius = 0.0127, density = 7800.0, young = 210e9, poisson = 0.3 }
arm = { stiffness = 2e6, rotation = inf }
contact = { dissipation = "none" }
preload = { force = 30.0 }
friction = { coefficient = 0.2 }
wall = { kind = "rom", file = "wall2.npz", young = 210e9, poisson = 0.3 }
damping = { kind = "rayleigh", alpha = 0.0, beta = 5e-5 }
time = { duration = 1e-3, error = 1e-3 }
output = { spheres = [1], samples = 2001 }
[[shakers]]
name = "wall"
on = "wall"
frequency = 100.0
force = 30.0
"""


@pytest.mark.parametrize(("force", "loop"), [(0.3, 9.0e-11), (3.0, 1.6172e-7), (30.0, 1.60484e-3)])
def test_a_shaken_sphere_without_a_striker_has_the_loop_of_an_independent_march(scene, force, loop):
    """And warnings speak of no striker."""
    K = np.array([[4.0e7, 5.0e6, 0.0], [5.0e6, 1.2e6, 0.0], [0.0, 0.0, 1.0e9]])
    np.savez(
        "wall2.npz", K=K, M=np.diag([3.0, 2.5, 1e4]), w=np.eye(3),
        w_load=np.array([[0.0], [1.0], [0.0]]), load_names=np.array(["wall"]),
    )  # fmt: skip
    summary = beadwave.impact(scene(SHAKEN), {"shakers.wall.force": force}).summary
    assert summary.friction.loop_energy_J == pytest.approx(loop, rel=0.02 if force < 1.0 else 2e-3)
    assert not any("striker" in words for words in summary.warnings)
