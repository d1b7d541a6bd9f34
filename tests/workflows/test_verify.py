"""Our results beside published figures and exact solutions, as rows."""

import json
import sys

import numpy as np
import pytest

from beadwave import dem, fem
from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence import api, groups
from beadwave.workflows.evidence.harness import compared, finding, rows_of, wrong


def row_of(run):
    """The only row of a group that yields, or raises, this."""

    def group():
        yield run()

    (row,) = rows_of("group", group)
    return row


def pair(ours, theirs, **options):
    return compared("x", ours, theirs, **{"allowed": 1e-3, "source": "a book", **options})


def rows_in(group):
    """All rows of a group."""
    return [*rows_of(group, groups.chosen("verify", (group,))[group])]


@pytest.mark.parametrize("folder", groups.MODULES)
def test_every_name_has_a_function_with_a_line_for_the_listing(folder):
    shown = groups.shown(folder)
    assert list(shown) == groups.names(folder)
    for name, line in shown.items():
        assert line.endswith(".") and len(line) <= 100, name


QUICK = ("solitary-wave", "contacts", "chain-and-wall", "friction")


@pytest.mark.parametrize("group", QUICK)
def test_published_and_exact_numbers_are_reached(group):
    rows = rows_in(group)
    assert len(rows) >= 6
    assert not [row for row in rows if row.verdict != "within"]


@pytest.mark.parametrize(
    "group",
    [
        "structures",
        "half-spaces",
        "reductions",
        pytest.param("second-waves", marks=pytest.mark.slow),
        "beams",
        pytest.param("gravity", marks=pytest.mark.slow),
        pytest.param("three-directions", marks=pytest.mark.slow),
    ],
)
def test_structures_reductions_and_waves_agree_with_theory(group):
    rows = rows_in(group)
    assert len(rows) >= 2
    assert not [row for row in rows if row.verdict != "within"], rows


def wrong_shear(monkeypatch):
    right = fem.beam

    def wrong(length, section, *others, **forces):
        stiffer = section._replace(shear_factor=section.shear_factor * (1 + 1e-6))
        return right(length, stiffer, *others, **forces)

    monkeypatch.setattr(fem, "beam", wrong)


def wrong_axial_force(monkeypatch):
    right = fem.beam
    monkeypatch.setattr(
        fem, "beam", lambda *of, axial_force: right(*of, axial_force=axial_force * (1 + 1e-6))
    )


def wrong_weight(monkeypatch):
    right = dem.Chain.steady.fget
    monkeypatch.setattr(dem.Chain, "steady", property(lambda chain: 1.0001 * right(chain)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("group", "error", "n_outside"),
    [
        ("beams", wrong_shear, 6),
        ("beams", wrong_axial_force, 6),
        ("gravity", wrong_weight, 2),
    ],
)
def test_an_error_on_purpose_is_outside(group, error, n_outside, monkeypatch):
    error(monkeypatch)
    rows = rows_in(group)
    assert sum(row.verdict == "outside" for row in rows) >= n_outside, rows


def test_the_difference_is_that_of_the_entries_that_differ_most():
    row = pair([1.0, 2.5, 3.0], [1.0, 2.0, 4.0])
    assert (row.ours, row.theirs, row.difference) == (3.0, 4.0, 0.25)
    assert pair([1.0, 2.5], [1.0, 2.0], of=0.1).difference == pytest.approx(5.0)
    assert np.isnan(pair([1.0, np.nan], [1.0, 2.0]).difference)


@pytest.mark.parametrize(
    ("ours", "verdict"), [(1.0005, "within"), (1.01, "outside"), (np.nan, "outside")]
)
def test_a_row_is_within_or_outside_of_what_is_allowed(ours, verdict):
    row = row_of(lambda: pair(ours, 1.0))
    assert row.verdict == verdict
    assert (wrong(finding("verify", (row,))) is None) == (verdict == "within")


def test_what_raises_has_failed_and_keeps_the_rows_before_it():
    def group():
        yield pair(1.0, 1.0)
        raise ZeroDivisionError("division by zero")

    first, second = rows_of("group", group)
    assert (first.verdict, second.verdict) == ("within", "failed")
    assert "division" in second.source
    assert "group: failed" in wrong(finding("verify", (first, second)))


def command(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["beadwave", "verify", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code


def test_the_command_prints_rows_for_machines_and_writes_the_table(capsys, monkeypatch, tmp_path):
    out = ("--group", "contacts", "--json", "--out", str(tmp_path))
    assert command(monkeypatch, *out) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["verdict"] for row in rows} == {"within"}
    assert any("Siconos" in row["source"] for row in rows)
    assert len((tmp_path / "verify.csv").read_text().splitlines()) == 1 + len(rows)


def test_a_row_outside_ends_in_status_1_and_its_name(capsys, monkeypatch):
    def off(folder, groups, progress):
        return finding("verify", (row_of(lambda: pair(2.0, 1.0)),))

    monkeypatch.setattr(api, "_verdicts", off)
    assert command(monkeypatch) == 1
    printed = capsys.readouterr()
    assert "x (outside)" in printed.out and "1 rows are outside" in printed.err


def test_groups_are_listed_and_an_unknown_one_is_bad_input(capsys, monkeypatch):
    assert command(monkeypatch, "--list") == 0
    assert set(QUICK) < {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert command(monkeypatch, "--group", "contact") == 2
    assert "contacts" in capsys.readouterr().err
