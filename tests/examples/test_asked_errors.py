"""The check of meshes that mesh.error leads to, on its smallest structure."""

import numpy as np
import pytest

import asked_errors

pytestmark = pytest.mark.usefixtures("shared_cache")


def test_even_unknowns_follow_the_line_of_logarithms():
    even = [(n, 3.0 * n**-1.2) for n in (1e3, 3e3, 9e3)]
    assert asked_errors.even_unknowns(even, 3.0 * 2e4**-1.2) == pytest.approx(2e4)
    assert np.isnan(asked_errors.even_unknowns(even[:1], 0.1))
    assert np.isnan(asked_errors.even_unknowns(even, np.nan))


@pytest.mark.slow
def test_a_thick_cantilever_has_the_error_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(asked_errors, "ASKED", (0.05,))
    monkeypatch.setattr(asked_errors, "MIDDLE", 0)
    monkeypatch.setattr(asked_errors, "SCALES", (2.0, 1.4))
    monkeypatch.setattr(asked_errors, "MOST_UNKNOWNS", 3e4)
    (row,) = asked_errors.compared(asked_errors.structure(0, 0, tmp_path))
    assert row.true < row.stated <= row.asked == 0.05
    assert len(row.ratios) > 3
    assert min(row.ratios) > 0.9
    assert "met by 100%" in asked_errors.summary([row])
