"""The rig's chain in its scenes: the arm's mass, and the warning of a thick plate."""

import pytest

from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.chain.chain import chain, start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.warnings import thick_plate


def test_the_arm_moves_with_the_last_sphere():
    heavy, light = (chain(scene(name)) for name in ("rig-1dof", "rig-rigid"))
    assert heavy.mass[-1] - light.mass[-1] == pytest.approx(0.134)
    assert heavy.mass[:-1] == pytest.approx(light.mass[:-1])


@pytest.mark.parametrize(("thickness", "warned"), [(0.01, False), (0.08, True)])
def test_a_run_on_a_plate_too_thick_for_zener_says_so(thickness, warned):
    """k h = 0.35 and 0.99 for the contact's 164 us."""
    rig = scene("rig-half-space", ("wall.kind=dashpot", f"wall.plate_thickness={thickness}"))
    sentences = list(thick_plate(rig, impact(rig, start(rig), wall_of(rig)).trajectory))
    assert any("k h = 0.99" in sentence for sentence in sentences) == warned
    assert any("thick relative to" in sentence for sentence in sentences) == warned
