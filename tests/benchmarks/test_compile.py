"""The table of compiled variants: a scene compiles only the functions that it enters."""

from collections import Counter

import pytest

import compile as benchmark


@pytest.mark.slow
def test_a_rigid_scene_compiles_each_kernel_once_and_no_implicit_one(capsys):
    variants = benchmark.main("rig-rigid")
    ours = Counter(variant[:2] for variant in variants if variant[0].startswith("beadwave.dem."))
    assert "beadwave.dem.kernels.explicit.march" in {function for function, _ in ours}
    assert set(ours.values()) == {1}
    assert not [function for function, _ in ours if "implicit" in function or "lanes" in function]
    assert min(seconds for _, _, seconds in variants) > 0.0
    assert f"rig-rigid: {len(variants)} variants of " in capsys.readouterr().out
