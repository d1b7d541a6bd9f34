"""The check of meshes that mesh.error leads to, on its smallest structure."""

from pathlib import Path

import numpy as np
import pytest

import asked_errors

pytestmark = pytest.mark.usefixtures("shared_cache")


def test_even_unknowns_follow_the_line_of_logarithms():
    even = [(n, 3.0 * n**-1.2) for n in (1e3, 3e3, 9e3)]
    assert asked_errors.even_unknowns(even, 3.0 * 2e4**-1.2) == pytest.approx(2e4)
    assert np.isnan(asked_errors.even_unknowns(even[:1], 0.1))
    assert np.isnan(asked_errors.even_unknowns(even, np.nan))


def test_shares_at_one_true_error_lie_between_those_of_the_errors_asked():
    def row(true, share):
        return asked_errors.Row("box", "box", "hex", 0.1, 0.1, "met", [9], share, 1, [0.1], [true])

    rows = [row(0.02, 0.5), row(0.005, 0.125), row(np.nan, 0.01)]
    assert asked_errors.share_at(rows, 0.01) == pytest.approx(0.25)
    assert asked_errors.share_at(rows, 0.004) == pytest.approx(0.125)
    assert np.isnan([asked_errors.share_at(rows, error) for error in (0.05, 0.002)]).all()
    assert np.isnan(asked_errors.share_at(rows[2:], 0.01))
    said = asked_errors.summary([*rows, *(each._replace(name="tube") for each in rows)])
    assert "at 1.0% 0.25, 0.25" in said and "at 5.0%" not in said


def test_every_kind_is_drawn_in_both_elements(tmp_path):
    n = len(asked_errors.KINDS)
    for number, kind in enumerate(asked_errors.KINDS):
        scenes = [asked_errors.structure(0, number + k, tmp_path) for k in (0, n)]
        assert {scene.mesh.element for scene in scenes} == {"hex", "tet"}
        assert scenes[0].name == f"{kind.__name__}-{number}"


def test_without_true_errors_it_says_what_is_met(tmp_path, capsys):
    asked_errors.main(["0", "1", "--asked", "0.1", "--split", "0", "--even", "0"])
    assert "met by 1 of 1" in capsys.readouterr().out


@pytest.mark.slow
def test_a_thick_cantilever_has_the_error_asked_for(tmp_path, monkeypatch):
    """Its row is kept in a file: a second call computes nothing."""
    monkeypatch.setattr(asked_errors, "MOST_UNKNOWNS", 3e4)
    path = tmp_path / "rows.jsonl"
    words = ["0", "1", "--asked", "0.05", "--even", "2", "--to", str(path)]
    asked_errors.main(words)
    (row,) = asked_errors.rows_of(path)
    assert row.true < row.stated <= row.asked == 0.05
    assert len(row.ratios) > 3
    assert min(row.ratios) > 0.9
    assert row.share < 1
    assert "met by 1 of 1" in asked_errors.summary([row])
    monkeypatch.setattr(asked_errors, "compared", lambda *a: pytest.fail("computed again"))
    asked_errors.main(words)
    assert len(asked_errors.rows_of(path)) == 1


@pytest.mark.slow
def test_a_step_file_floats_and_has_the_error_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(asked_errors, "MOST_UNKNOWNS", 1e5)
    bracket = asked_errors.bracket(np.random.default_rng(3), tmp_path)["assembly"]["step"]
    scene = asked_errors.part(Path(bracket))
    (row,) = asked_errors.compared(scene, "part", (0.05,), ())
    assert row.true < row.stated <= 0.05
    assert min(row.ratios) > 0.9
    assert np.isnan(row.stated_of[-1])  # what floats has no static compliance
