"""Benchmark of bolted plates, run small."""

import bolted_plates
import pytest


@pytest.mark.slow
def test_the_benchmark_of_bolted_plates_counts_and_compares_its_modes(capsys):
    """Two plates with one bolt: every stage has its row, and the modes about a further roughness
    are those of a factor of their own."""
    rows = dict(bolted_plates.main(4.0, n_bolts=1))
    assert list(rows) == [
        "first contact", "a further preload", "a further friction", "a further roughness",
        "the modes about that roughness", "these by a factor of their own", "the two differ by",
        "six modes at twenty amplitudes", "these over the first contact",
    ]  # fmt: skip
    assert 0 < rows["the two differ by"] < 1e-6
    assert "unknowns, " in capsys.readouterr().out
