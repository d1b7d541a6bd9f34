"""The table of compiled variants: what a scene does not enter is not compiled for it."""

from collections import Counter

import pytest

import beadwave


@pytest.mark.slow
def test_a_rigid_scene_compiles_each_kernel_once_and_no_implicit_one():
    finding = beadwave.accuracy("rig-rigid", stage="compile")
    table = next(table for table in finding.tables if table.name == "accuracy")
    variants = Counter(zip(table.column("method"), table.column("parameter"), strict=True))
    ours = {variant: n for variant, n in variants.items() if variant[0].startswith("beadwave.dem.")}
    assert "beadwave.dem.kernels.explicit.march" in {function for function, _ in ours}
    assert set(ours.values()) == {1}
    assert not [function for function, _ in ours if "implicit" in function or "lanes" in function]
    assert min(table.column("seconds")) > 0.0


def test_a_wall_that_is_read_elsewhere_than_pushed_is_refused_with_its_scene():
    with pytest.raises(beadwave.InvalidScene, match=r"rig-rom: --stage compile needs .* rig-rigid"):
        beadwave.accuracy("rig-rom", ["patch.weights=thesis"], stage="compile")
