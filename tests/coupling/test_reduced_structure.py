"""Several contacts of a reduced structure, beside the structure in full."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from beadwave import coupling, dem, rom
from beadwave.coupling.reduced_structure import require_answer, structure_of
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere

N = 60  # masses of 20 g on springs of 4e7 N/m: modes from 300 Hz to 14 kHz
ENDS = (N - 1, N // 3)
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
LOCAL = np.array([[2e-9, 0.0], [1e-9, 0.0]])  # of the static compliances of some 1e-6 m/N


def matrices():
    link = np.diff(np.eye(N), axis=0)
    K = 4e7 * (link.T @ link)
    K[0, 0] += 4e7
    return sp.csc_array(K), sp.csc_array(0.02 * np.eye(N))


def in_full(half_space):
    K, M = matrices()
    square, shapes = eigh(K.toarray(), M.toarray())
    phi = shapes[list(ENDS)]
    zeta = np.full(N, 0.01)
    return space.Structure(np.sqrt(square), zeta, phi, np.arange(2), DIRECTIONS, -half_space)


def struck(structure):
    row = dem.row_of_spheres(6e-3, 7800.0, 210e9, 0.3, count=4, flat=dem.Flat(210e9, 0.3))
    velocity = 0.3 * np.eye(4)[0]
    rows = space.rows_of(
        [
            space.Row(row, velocity, np.zeros(3), DIRECTIONS[0]),
            space.Row(row, 0.5 * velocity, np.zeros(3), DIRECTIONS[1], 5e-5),
        ],
        structure,
    )
    march = space.march_to_error(
        rows.packing, structure, rows.velocity, duration=8e-4, error=1e-6, n_save=200
    )
    return rows, march


def test_two_chains_on_the_reduced_structure_move_as_on_the_whole():
    K, M = matrices()
    W = np.eye(N)[:, list(ENDS)]
    reduced = rom.several_contacts(K, M, W, error=1e-4, to_hz=9e3)
    assert len(reduced.w) < N - 8
    columns = np.column_stack([reduced.w, reduced.columns.load])
    mine = structure_of(
        reduced, columns, [0, 1], DIRECTIONS, LOCAL, damping=coupling.ModalDamping(0.01)
    )
    assert mine.omega.size < N
    _, of_mine = struck(mine)
    _, of_whole = struck(in_full(LOCAL))
    difference = np.abs(of_mine.velocity - of_whole.velocity).max() / 0.3
    assert difference < 2e-3
    # the static response between both is not there: another motion by ten times as much
    apart = structure_of(
        reduced, columns * [[1.0, 0.0]], [0, 1], DIRECTIONS, LOCAL,
        damping=coupling.ModalDamping(0.01),
    )  # fmt: skip
    _, of_apart = struck(apart)
    assert np.abs(of_apart.velocity - of_whole.velocity).max() / 0.3 > 10 * difference


def test_a_contact_stiffer_than_what_is_taken_off_for_it_is_refused():
    structure = in_full(np.array([[2e-7, 0.0], [1e-9, 0.0]]))
    row = dem.row_of_spheres(6e-3, 7800.0, 210e9, 0.3, count=2, flat=dem.RIGID)
    rows = space.rows_of(
        [space.Row(row, np.array([0.3, 0.0]), np.zeros(3), d) for d in DIRECTIONS], structure
    )
    with pytest.raises(coupling.CouplingError, match="leave no unique force"):
        require_answer(rows.packing, structure, rows.velocity)


def test_a_contact_that_rubs_across_a_larger_negative_compliance_is_refused():
    """At the largest force the contact that sticks gives way across by 1/k_t."""
    axes = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    row = dem.row_of_spheres(6e-3, 7800.0, 210e9, 0.3, count=2, flat=dem.Flat(210e9, 0.3))
    law = tangential_law(0.2, 6e-3, 210e9, 0.3, np.inf, 210e9, 0.3)
    last = LastSphere(law, 0.4 * float(row.mass[-1]) * 6e-3**2, np.zeros(2))
    k_n = 1.5 * row.A[-1] * np.sqrt((2.5 * 0.5 * row.mass[0] * 0.3**2 / row.A[-1]) ** 0.4)
    k_t = k_n * 2 * (1 - 0.3) / (2 - 0.3)
    for share, refused in ((0.9, False), (1.1, True)):
        structure = space.Structure(
            np.array([1e4]), np.zeros(1), np.ones((3, 1)), np.zeros(3, np.int64), axes,
            np.array([[0.0, -share / k_t]]),
        )  # fmt: skip
        rows = space.rows_of(
            [space.Row(row, np.array([0.3, 0.0]), np.zeros(3), axes[0], last=last)], structure
        )
        if not refused:
            require_answer(rows.packing, structure, rows.velocity)
            continue
        with pytest.raises(coupling.CouplingError, match="leave no unique force"):
            require_answer(rows.packing, structure, rows.velocity)
