"""Tables of measured signals: the grid of their instants, and what a CSV may look like."""

import numpy as np
import pytest

from beadwave.workflows.files.signal_table import even_step, signal_table


@pytest.mark.parametrize("digits", [6, 3, 2])
def test_times_written_with_few_digits_are_even(digits):
    """By whole decimals, and by six significant digits, whose last one grows tenfold at 10 s."""
    t = np.arange(400_000) / 51_200 * (1 if digits < 6 else 3)
    written = np.round(t, digits) if digits < 6 else np.array([float(f"{x:.6g}") for x in t])
    assert even_step(written, 64) == pytest.approx(t[1], rel=1e-6)


def test_times_that_jump_or_shake_are_not_even():
    t = np.arange(40_000) / 51_200
    missing = np.round(np.delete(t, slice(10_000, 10_400)), 3)  # 8 ms, of digits of 1 ms
    shaken = np.sort(t + 2e-5 * np.random.default_rng(0).standard_normal(len(t)))
    paired = np.repeat(t[::2], 2)  # each second sample late
    for times in (missing, shaken, paired**1.1, np.zeros(40_000)):
        with pytest.raises(ValueError, match=r"not evenly spaced|does not grow|a gap of"):
            even_step(times, 64)


VALUES = np.random.default_rng(0).normal(size=(60, 3))


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("comments", ["", "# "])
def test_a_table_is_read_whatever_stands_between_its_cells(tmp_path, delimiter, comments):
    """numpy writes the header as a comment unless it is told otherwise."""
    path, names = tmp_path / "a.csv", ["time [s]", "force 1+z [N]", "response 2+z [g]"]
    header = f"# a title\n{delimiter.join(names)}" if not comments else delimiter.join(names)
    np.savetxt(path, VALUES, delimiter=delimiter, header=header, comments=comments)
    table = signal_table(path)
    assert table.header == tuple(names) and table.title == ("" if comments else "a title")
    np.testing.assert_array_equal(table.values, VALUES)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("1,2", "line 5 has 2 cells, those before it have 3"),
        ("1,,3", "line 5 has no number in the column 'b': '1,,3'"),
        ("1,2,inf", "line 5 has no number in the column 'c'"),
        ("1,2,3 mm", "line 5 is not numbers with decimal points: '1,2,3 mm'"),
    ],
)
def test_a_line_at_fault_is_named_by_its_number(tmp_path, line, sentence):
    path = tmp_path / "a.csv"
    path.write_text(f"# title\n\na,b,c\n1,2,3\n{line}\n1,2,3\n", encoding="utf-8")
    with pytest.raises(ValueError, match=sentence):
        signal_table(path)
