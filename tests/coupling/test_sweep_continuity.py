"""One reflected wave over a map: later waves, and points that cannot be told, are left out."""

import numpy as np
import pytest

from beadwave.workflows.sweep.core.continuity import neighbours, same_wave

WIDTH = 60e-6  # s
ROWS, COLUMNS = 16, 12


def grid(rows=ROWS, columns=COLUMNS):
    return np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), -1).reshape(
        -1, 2
    )


def scans():
    """Times [s] of the first wave picked on five faces, and where it is a later one.

    The first wave comes sooner towards a held edge, later towards a free one; the later waves are
    those that a run finds where the first one falls below the threshold of a pick.
    """
    x, y = grid().T / np.array([[ROWS - 1], [COLUMNS - 1]])
    middle = np.hypot(x - 0.5, y - 0.5)
    smooth = 350e-6 + 40e-6 * x**2
    bowl = 345e-6 + 100e-6 * middle**2
    waves = 360e-6 + 15e-6 * np.sin(7 * x) * np.cos(5 * y)
    tilted = 400e-6 + 120e-6 * x + 60e-6 * y  # three widths over the face
    edge, corners = x > 0.95, middle > 0.6
    spot, strip = np.hypot(x - 0.3, y - 0.6) < 0.2, np.abs(y - 0.5) < 0.1
    steep = 345e-6 + 200e-6 * x**3
    return {
        "a row of an edge": (np.where(edge, 970e-6, smooth), edge),
        "corners": (np.where(corners, bowl + 1.1 * WIDTH, bowl), corners),
        "a spot": (np.where(spot, waves + 2 * WIDTH, waves), spot),
        "a strip": (np.where(strip, tilted + 1.5 * WIDTH, tilted), strip),
        "two waves": (steep + WIDTH * (5 * edge + 1.3 * spot), edge | spot),
    }  # fmt: skip


LEAST = {"a strip": 0.45, "two waves": 0.6}  # of the first wave; a strip parts it in two


@pytest.mark.parametrize("name", ["a row of an edge", "corners", "a spot"])
def test_the_later_wave_is_left_out_and_nothing_else(name):
    time, later = scans()[name]
    assert np.array_equal(same_wave(grid(), time, WIDTH), ~later)


@pytest.mark.parametrize("kept", [pytest.param(0.9, marks=pytest.mark.slow), 0.6, 0.35, 0.2])
@pytest.mark.parametrize("name", scans())
def test_no_later_wave_stays_in_a_thinned_scan(name, kept):
    time, later = scans()[name]
    rng = np.random.default_rng(7)
    shares = []
    for _ in range(60):
        there = rng.random(len(time)) < kept
        for thinned in (np.where(there, time, np.nan), time[there]):
            points = grid() if len(thinned) == len(time) else grid()[there]
            same = same_wave(points, thinned, WIDTH)
            of = later if len(thinned) == len(time) else later[there]
            assert not (same & of).any()
            shares.append(same.sum() / (there & ~later).sum())
    least = LEAST.get(name, 0.95)
    assert np.median(shares) > (least if kept > 0.5 else least - 0.15)


# First reflected waves [us], 59 us wide, at sphere 14 of a chain over a steel plate of 4 mm that is
# held at one edge (the first row); half of a mirrored map. Along the free edge the wave comes later
# and later until it is lost; elsewhere it comes from 778 to 849 us.
PLATE = """
    780 779 779 778 779 779
    834 802 800 800 800 801
    920 848 829 830 829 829
    1020 955 841 849 842 844
    1133 - 839 - 835 837
    1257 - 839 837 836 838
    - - 839 - 836 838
    - - 841 839 838 839
    - - 841 839 838 839
    - - 839 - 836 838
    - - 839 - 836 838
    - - 839 - 836 837
    - - - - - 839
    - - 844 - 839 841
    - - - - - -
    - - - - - -
"""


def test_no_later_wave_stays_in_a_thinned_scan_of_a_plate():
    half = np.array([line.split() for line in PLATE.strip().splitlines()])
    half = np.where(half == "-", "nan", half).astype(float)
    time, width = 1e-6 * np.hstack([half, half[:, ::-1]]).ravel(), 59e-6
    same = same_wave(grid(), time, width)
    wave = (time > 777e-6) & (time < 850e-6)
    assert not (same & ~wave).any() and same.sum() > 0.9 * wave.sum()
    rng = np.random.default_rng(3)
    for kept in np.repeat([0.9, 0.7, 0.5, 0.3, 0.2], 20):
        there = rng.random(len(time)) < kept
        same = same_wave(grid(), np.where(there, time, np.nan), width)
        assert not (same & ~wave).any()
        assert same.sum() > 0.5 * (wave & there).sum()


def test_a_map_without_jumps_is_kept_whole():
    time = 3e-4 + 1e-5 * np.sin(grid().sum(axis=1))
    assert same_wave(grid(), time, WIDTH).all()
    assert not same_wave(grid(), np.full(len(time), np.nan), WIDTH).any()
    assert same_wave([[0, 0]], [3e-4], WIDTH).all()
    assert same_wave([[0, 0], [0, 1]], [3e-4, 3.1e-4], WIDTH).all()


def test_a_mirrored_map_leaves_out_mirrored_points():
    time, _ = scans()["corners"]
    time = time.reshape(ROWS, COLUMNS)
    same = same_wave(grid(), time.ravel(), WIDTH).reshape(ROWS, COLUMNS)
    for axis in (0, 1):
        other = same_wave(grid(), np.flip(time, axis).ravel(), WIDTH).reshape(ROWS, COLUMNS)
        assert np.array_equal(np.flip(other, axis), same)


def test_waves_that_continuity_leads_around_to_are_told_apart_or_left_out():
    """Around the middle of a helical map the time rises by two widths: no cut of it is a wave's."""
    x, y = grid(12, 12).T - 5.5
    time = 4e-4 + 2 * WIDTH * (np.arctan2(y, x) / (2 * np.pi) + 0.5)
    same = same_wave(grid(12, 12), time, WIDTH)
    one, other = neighbours(grid(12, 12)).T
    jump = np.abs(time[one] - time[other])[same[one] & same[other]]
    assert (jump <= 0.75 * WIDTH).all()


def test_a_later_wave_at_most_points_of_a_thinned_scan_is_not_taken_for_the_first():
    """Of a 3 x 3 map four points have the first wave, at two places apart; five a later one."""
    later = np.array([0, 1, 0, 1, 1, 1, 0, 1, 0], bool)
    time = np.where(later, 4.5e-4, 3e-4)
    assert not (same_wave(grid(3, 3), time, WIDTH) & ~later).any()  # one wave in any case
    few = np.where(np.arange(9) == 4, np.nan, time)  # four of eight
    assert not (same_wave(grid(3, 3), few, WIDTH) & later).any()


def test_neighbours_of_a_grid_are_steps_along_it_and_both_diagonals():
    pairs = neighbours(grid(4, 3))
    steps = np.abs(np.diff(grid(4, 3)[pairs], axis=1)[:, 0])
    assert len(pairs) == 3 * 3 + 4 * 2 + 2 * 3 * 2 and steps.max() == 1
    assert neighbours([[0, 0], [3, 0], [1, 0]]).tolist() == [[0, 2], [1, 2]]
    assert not len(neighbours([[0, 0]]))
