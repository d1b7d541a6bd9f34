"""Measured modes of a cantilever paired with computed ones, at points drawn at random."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

WHERE = spec_from_file_location("pairing", Path(__file__).parents[2] / "examples" / "pairing.py")
EXAMPLE = module_from_spec(WHERE)
WHERE.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def structure():
    return EXAMPLE.modes_outside("cantilever")


@pytest.mark.parametrize("seed", range(40))
def test_pairs_are_one_to_one_and_distant_ones_are_doubtful(structure, seed):
    phi, hz = structure
    pairs, _, measured_hz = EXAMPLE.paired(phi, hz, seed)
    taken = pairs.index[pairs.index >= 0].tolist()
    assert taken and len(set(taken)) == len(taken)
    for hz_measured, j, doubts in zip(measured_hz, pairs.index, pairs.doubts, strict=True):
        apart = abs(hz[j] / hz_measured - 1) if j >= 0 else 0.0
        assert (apart > 0.2) == any("% apart" in doubt for doubt in doubts)


def test_pairs_of_which_nothing_is_said_are_right(monkeypatch, capsys):
    """By frequency alone 89 % were, of a third as many."""
    monkeypatch.setattr(EXAMPLE, "ASSEMBLIES", ("cantilever",))
    ((number, doubtful, alike, right, _),) = EXAMPLE.main(40, 100).values()
    assert number > 300 and number - doubtful - alike > 150
    assert right > 0.97
