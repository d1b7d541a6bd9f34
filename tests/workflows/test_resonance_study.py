"""The study of resonance on the shaken rig, on a coarse mesh, two forces and few frequencies."""

from contextlib import nullcontext

import pytest

from beadwave.coupling.resonance import HarmonicBalance
from beadwave.workflows.evidence.thesis.resonance import ResonanceOptions, resonance
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene

from command_line import COARSE_RIG


def quiet(stage):
    return nullcontext()


@pytest.mark.parametrize("name", ["rig-rom", "shaken-plane"])
def test_a_scene_without_a_shaken_structure_is_refused(name):
    with pytest.raises(InvalidScene, match="take rig-shaker"):
        resonance(scene(name), quiet)


@pytest.mark.slow
def test_slip_lowers_the_resonance_and_damps_it():
    """Between the mode on a contact that sticks and the one without friction: the harder the
    shaker pushes, the lower the peak and the less it moves for a newton."""
    options = ResonanceOptions(
        forces=(0.05, 2.0), n_frequencies=7, checked=(), balance=HarmonicBalance(n_harmonics=5)
    )
    rig = scene("rig-shaker", (*COARSE_RIG, "reduction.modes=20"))
    finding = resonance(rig, quiet, options)
    table = finding.tables[0]
    (weak, strong), per_force = table.column("peak_hz"), table.column("per_force_um_N")
    assert strong < weak
    assert per_force[1] < per_force[0]
    assert table.column("damping")[1] > 5 * table.column("damping")[0]
    assert max(table.column("up_down")) < 0.05
    assert any(sentence.startswith("Without friction") for sentence in finding.sentences)
