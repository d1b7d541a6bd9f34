"""What waves say of a beam: studies of its axial force, and of theories beside the solid."""

from contextlib import nullcontext

import pytest

from beadwave.workflows.evidence.thesis.axial_force import AxialForceOptions, axial_force
from beadwave.workflows.evidence.thesis.solid_beam import SolidBeamOptions, solid_beam
from beadwave.workflows.files.scene import scene

pytestmark = pytest.mark.usefixtures("shared_cache")


def rows(finding):
    table = finding.tables[0]
    return [dict(zip(table.columns, row, strict=True)) for row in table.rows]


def quiet(stage):
    return nullcontext()


@pytest.mark.slow
def test_the_first_reflected_wave_does_not_feel_an_axial_force_and_later_ones_do():
    """0.9 of the buckling load either way: 0.8 % of the striker's velocity, and 37 % later."""
    options = AxialForceOptions(shares=(0.9, 0.0, -0.9))
    pulled, free, pressed = rows(axial_force(scene("slender-beam"), quiet, options))
    for loaded in (pulled, pressed):
        assert loaded["first_wave"] < 0.01 < 0.3 < loaded["later"]
        assert abs(loaded["tof_us"] - free["tof_us"]) < 3
        assert abs(loaded["arr"] / free["arr"] - 1) < 0.01
    assert 3 < pulled["later_ms"] < pressed["later_ms"] < 8
    assert pressed["first_mode_hz"] == pytest.approx(0.1**0.5 * free["first_mode_hz"], rel=1e-3)
    assert pulled["first_mode_hz"] == pytest.approx(1.9**0.5 * free["first_mode_hz"], rel=1e-2)


@pytest.mark.slow
def test_a_solid_beam_lies_at_timoshenkos_waves_and_not_at_euler_bernoullis():
    """A stocky one, as narrow as theory has it, struck beside its middle."""
    short = ("length=0.25", "width=0.01", "thickness=0.02", "position=0.12")
    run = ("chain.count=8", "time.duration=1.2e-3", "output.spheres=[1, 4]")
    chosen = scene("beam", (*(f"beam.{change}" for change in short), *run))
    timoshenko, euler, solid = rows(solid_beam(chosen, quiet, SolidBeamOptions(factors=(1.0,))))
    for theory in (timoshenko, euler):
        theory["tof"] = abs(theory["tof_us"] - solid["tof_us"])
        theory["ratio"] = abs(theory["arr"] / solid["arr"] - 1)
        theory["fifth"] = abs(theory["fifth_hz"] / solid["fifth_hz"] - 1)
    for error in ("tof", "ratio", "fifth", "off_solid"):
        assert timoshenko[error] < 0.5 * euler[error], error
    assert timoshenko["off_solid"] < 0.01 and timoshenko["tof"] < 1.0
