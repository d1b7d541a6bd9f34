"""Chains on points of one structure: beside the chain's own engine, DOP853, and by symmetry."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling.spatial_march import march_space
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere

from rows_reference import random_rubbing_rows, rows_reference

R, RHO, E, NU = 6e-3, 7800.0, 210e9, 0.3
STEEL = dem.Flat(210e9, 0.3)
LEFT, RIGHT = np.array([0.0, 0.0, -1.0]), np.array([0.8, 0.6, 0.0])


def chain(n, **fields):
    return dem.row_of_spheres(R, RHO, E, NU, count=n, flat=STEEL, **fields)


def striking(n, speed):
    return np.eye(n)[0] * speed


def structure(phi, omega, zeta, residual):
    phi = np.atleast_2d(phi)
    p = len(phi)
    directions = np.array([LEFT, RIGHT])[:p]
    return space.Structure(
        np.asarray(omega, float), np.asarray(zeta, float), phi, np.arange(p), directions,
        np.column_stack([residual, np.zeros(p)]),
    )  # fmt: skip


def rows_on(chains, velocities, delays, behind):
    given = zip(chains, velocities, (LEFT, RIGHT), delays, strict=False)
    return space.rows_of(
        [space.Row(c, v, np.zeros(3), d, t) for c, v, d, t in given], behind
    )  # fmt: skip


OMEGA = 2 * np.pi * np.array([900.0, 2600.0, 7100.0, 19e3])
ZETA = np.array([0.01, 0.02, 0.0, 0.3])
PHI = np.array([[1.3, -0.7, 2.0, 5.0], [0.9, 1.5, -1.1, 3.0]])
SERIES = np.array([-1.2e-9, -0.8e-9])
PARTS = {
    "bare": {},
    "damped": {"dissipation": "hunt-crossley", "gamma": 0.4},
    "held": {"preload": 20.0, "leaf_stiffness": np.full(5, 4e3)},
    # pressed to some 1.5 um
    "yielding": {"yield_overlap": np.full(5, 7e-7)},
}


# each row is marched by code of its own, compiled in 5 to 17 s
def few_quick(cases, *quick):
    return [case if case in quick else pytest.param(case, marks=pytest.mark.slow) for case in cases]


@pytest.mark.parametrize("parts", few_quick(PARTS, "damped"))
def test_a_row_that_feels_no_other_is_the_chain_on_its_wall(parts):
    """The other row's modes do not move its point: both engines within their errors."""
    apart = np.zeros((2, 8))
    apart[0, :4], apart[1, 4:] = PHI
    behind = structure(apart, np.tile(OMEGA, 2), np.tile(ZETA, 2), SERIES)
    fields = dict(PARTS[parts])
    limit = fields.pop("yield_overlap", None)
    chains = [chain(5, **fields)._replace(yield_overlap=limit)] * 2
    velocities = [striking(5, 0.3), striking(5, 0.2)]
    rows = rows_on(chains, velocities, (0.0, 0.0), behind)
    run = {"duration": 6e-4, "error": 1e-6, "n_save": 300}
    mine = space.march_to_error(rows.packing, behind, rows.velocity, **run)
    for i, of_row in enumerate(space.row_runs(rows, behind, mine)):
        wall = dem.Wall(OMEGA, ZETA, PHI[i], SERIES[i])
        alone = dem.march_to_error(chains[i], wall, velocities[i], **run).trajectory
        # 1e-6 of the largest velocity by each engine; a factor of 2 for two marches
        assert np.abs(of_row.v - alone.v).max() < 4e-6 * 0.3
        assert np.abs(of_row.wall_v - alone.wall_v).max() < 4e-6 * 0.3
        peak = alone.contact_force.max()
        assert np.abs(of_row.contact_force - alone.contact_force).max() < 2e-5 * peak
        assert np.abs(of_row.x - (alone.x - alone.x[0])).max() < 1e-6 * 0.3 * 6e-4 * 4
    assert mine.energy_error < 1e-8


@pytest.mark.parametrize("weight", [0.0, 400.0])  # m/s^2: 0.16 m/s over the march
def test_two_rows_that_feel_each_other_meet_dop853_within_the_stated_error(weight):
    behind = structure(PHI, OMEGA, ZETA, SERIES)
    falling = {"gravity": weight, "n_falling": 1} if weight else {}
    chains = [chain(4, **falling), chain(3, **falling)]
    velocities = [striking(4, 0.3), striking(3, 0.25)]
    delays = 0.0, 4e-5
    rows = rows_on(chains, velocities, delays, behind)
    error = 1e-5
    mine = space.march_to_error(
        rows.packing, behind, rows.velocity, duration=4e-4, error=error, n_save=100
    )
    x, v = rows_reference(chains, velocities, delays, behind, mine.t)
    runs = space.row_runs(rows, behind, mine)
    of_mine = np.hstack([run.v for run in runs])
    true = np.abs(of_mine - v).max() / 0.3
    assert true < mine.error_estimate < 1.01 * error
    moved = np.hstack([run.x - run.x[0] for run in runs])
    assert np.abs(moved - (x - x[0])).max() < error * 0.3 * 4e-4
    assert mine.energy_error < 1e-2 * error
    mass = np.concatenate([chain.mass for chain in chains])
    np.testing.assert_allclose(mine.work_gravity, weight * moved @ mass, rtol=1e-9, atol=1e-15)
    # and not so without what the points feel of each other
    deaf = structure(PHI * [[1, 1, 1, 1], [0, 0, 0, 0]], OMEGA, ZETA, SERIES)
    alone = space.march_to_error(
        rows.packing, deaf, rows.velocity, duration=4e-4, error=error, n_save=100
    )
    other = np.hstack([run.v for run in space.row_runs(rows, deaf, alone)])
    assert np.abs(other - v).max() / 0.3 > 0.01


def test_mirrored_rows_are_one_on_the_symmetric_modes():
    """Of a symmetric structure each symmetric participation counts sqrt 2 times, and the residual
    is S11 + S12: here S12 = 0 as it is in the modes."""
    phi = np.array([[1.3, 0.7, 2.0, 5.0], [1.3, -0.7, 2.0, -5.0]])
    behind = structure(phi, OMEGA, ZETA, np.full(2, -1e-9))
    rows = rows_on([chain(5)] * 2, [striking(5, 0.3)] * 2, (0.0, 0.0), behind)
    run = {"duration": 6e-4, "error": 1e-6, "n_save": 300}
    mine = space.row_runs(
        rows, behind, space.march_to_error(rows.packing, behind, rows.velocity, **run)
    )
    half = dem.Wall(OMEGA[[0, 2]], ZETA[[0, 2]], np.sqrt(2) * phi[0, [0, 2]], -1e-9)
    one = dem.march_to_error(chain(5), half, striking(5, 0.3), **run).trajectory
    for row in mine:
        assert np.abs(row.v - one.v).max() < 4e-6 * 0.3


def test_a_row_that_comes_later_has_its_waves_later():
    """On a wall that does not move the second row is the first one, later by its delay."""
    behind = structure(np.zeros((2, 1)), [1e4], [0.0], np.zeros(2))
    delay = 1e-4
    rows = rows_on([chain(4)] * 2, [striking(4, 0.3)] * 2, (0.0, delay), behind)
    march = space.march_to_error(
        rows.packing, behind, rows.velocity, duration=6e-4, error=1e-6, n_save=600
    )
    first, second = space.row_runs(rows, behind, march)
    n = 100  # saves of 1 us
    assert np.abs(second.v[n:] - first.v[:-n]).max() < 4e-6 * 0.3
    assert np.abs(second.x[n:] - first.x[:-n]).max() < 1e-9
    assert second.x[0, 0] == pytest.approx(-0.3 * delay, rel=1e-12)


# participations along n, t1, t2 of one point; S of its contact, and what a mesh has besides
ALONG_AND_ACROSS = np.array([[1.3, -0.7, 2.0, 5.0], [0.9, 1.5, -1.1, 3.0], [0.4, -0.6, 0.8, -2.0]])
AXES = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
BESIDES = 1e-10 * np.array([[0.0, 0.6, -0.3], [0.6, 0.2, 0.4], [-0.3, 0.4, -0.2]])
STEEL_ON_STEEL = (R, E, NU, np.inf, E, NU)
RUBBING = {
    "free": ({}, {}, {}),
    "alone": ({"count": 1}, {}, {"velocity": np.array([0.1, 0.05])}),
    # the wave announces itself by overlaps of 1e-320 m
    "long": ({"count": 9}, {"S": True}, {}),
    "damped": ({"dissipation": "hunt-crossley", "gamma": 0.4}, {"S": True}, {}),
    "on an arm": (
        {"preload": 20.0, "leaf_stiffness": np.array([0.0, 4e3, 4e3, 4e3])}, {"S": True},
        {"arm_stiffness": np.array([2e6, np.inf]), "arm_rotation": 5.0},
    ),
    "held against turns": (
        {"preload": 20.0}, {},
        {"arm_stiffness": np.array([2e6, 1e5]), "arm_rotation": np.inf},
    ),
    "on the sphere before": (
        {"dissipation": "hunt-crossley", "gamma": 0.4}, {"S": True},
        {"before": tangential_law(0.1, R, E, NU, R, E, NU)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", few_quick(RUBBING, "on an arm"))
def test_a_row_that_rubs_is_the_chain_with_friction_on_its_structure(case):
    """Another march of the same contact: velocities, forces, slip, heat within both errors."""
    of_chain, of_wall, of_last = RUBBING[case]
    fields = dict(of_chain)
    n = fields.pop("count", 4)
    one = chain(n, **fields)
    law = tangential_law(0.2, *STEEL_ON_STEEL)
    inertia = 0.4 * float(one.mass[-1]) * R**2
    last = LastSphere(law, inertia, **({"velocity": np.zeros(2)} | of_last))
    S = np.diag([-1.2e-9, -1e-9, -1e-9]) if of_wall else np.zeros((3, 3))
    besides = BESIDES if of_wall else np.zeros((3, 3))
    run, error = {"duration": 3e-4, "n_save": 150}, 1e-5
    wall = spatial_wall_of_modes(OMEGA, ZETA, ALONG_AND_ACROSS.T)
    wall = wall._replace(residual_compliance=S + besides)
    alone = march_space(one, wall, striking(n, 0.3), last, error=error, **run)

    behind = space.Structure(
        OMEGA, ZETA, ALONG_AND_ACROSS, np.zeros(3, np.int64), AXES,
        np.array([[S[0, 0], S[1, 1]]]), besides[None],
    )  # fmt: skip
    rows = space.rows_of(
        [space.Row(one, striking(n, 0.3), np.zeros(3), AXES[0], last=last)], behind
    )
    mine = space.march_to_error(rows.packing, behind, rows.velocity, error=error, **run)
    (row,) = space.row_runs(rows, behind, mine)
    stated = mine.error_estimate + alone.lateral.error_estimate
    assert stated < 2 * error
    across, other = row.across, alone.lateral
    assert np.abs(row.v - alone.trajectory.v).max() < stated * 0.3
    assert np.abs(across.sphere_t_v - other.sphere_t_v).max() < stated * 0.3
    assert R * np.abs(across.sphere_spin - other.sphere_spin).max() < stated * 0.3
    # what follows from velocities: over the run, and by the contact's stiffness of some 4e7 N/m
    length = stated * 0.3 * 3e-4
    assert np.abs(across.slip - other.slip).max() < length
    assert np.abs(across.sphere_t - other.sphere_t).max() < length
    peak = np.abs(other.friction_force).max()
    assert peak > 0.3
    assert np.abs(across.friction_force - other.friction_force).max() < 2e-4 * peak
    assert np.abs(across.wall_t - other.wall_t).max() < 2 * length
    heat = other.dissipated_friction[-1]
    assert across.dissipated_friction[-1] == pytest.approx(
        heat - (mine.dissipated_friction - across.dissipated_friction)[-1], rel=1e-3
    )
    assert mine.energy_error < 0.2 * error


def test_both_contacts_of_the_last_sphere_rub_by_their_own_laws():
    at_wall, before = tangential_law(0.2, *STEEL_ON_STEEL), tangential_law(0.1, R, E, NU, R, E, NU)
    last = LastSphere(at_wall, 1e-6, np.zeros(2))._replace(before=before)
    behind = space.Structure(
        OMEGA, ZETA, ALONG_AND_ACROSS, np.zeros(3, np.int64), AXES, np.zeros((1, 2))
    )
    row = space.Row(chain(4), striking(4, 0.3), np.zeros(3), AXES[0], last=last)
    packing = space.rows_of([row], behind).packing
    springs, ends = packing.springs, packing.pairs[packing.springs.contact]
    assert (ends[0, 0], ends[0, 1]) == (3, space.MOVING) and sorted(ends[1]) == [2, 3]
    for i, law in enumerate((at_wall, before)):
        assert [values[i] for values in springs.law] == list(law[:3])
        np.testing.assert_allclose(springs.frame[i], AXES[1:])


@pytest.mark.parametrize("gamma", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_row_that_rubs_is_marched_with_order_2(gamma):
    """An oblique impact that slips all over; with a damper, whose pressure bounds the slip, too."""
    fields = {"dissipation": "hunt-crossley", "gamma": gamma} if gamma else {}
    one = chain(1, **fields)
    last = LastSphere(
        tangential_law(0.1, *STEEL_ON_STEEL), 0.4 * float(one.mass[-1]) * R**2,
        np.array([0.5, 0.2]),
    )  # fmt: skip
    behind = space.Structure(
        OMEGA, ZETA, ALONG_AND_ACROSS, np.zeros(3, np.int64), AXES, np.array([[-1.2e-9, -1e-9]]),
        BESIDES[None],
    )  # fmt: skip
    rows = space.rows_of(
        [space.Row(one, striking(1, 0.3), np.zeros(3), AXES[0], last=last)], behind
    )
    run = {"duration": 6e-5, "n_save": 30}
    marches = [
        space.march(rows.packing, behind, rows.velocity, dt=dt, **run)
        for dt in (1e-7, 5e-8, 2.5e-8)
    ]
    for name in ("velocity", "angular_velocity"):
        a, b, c = (getattr(found, name) for found in marches)
        assert 3.8 < np.abs(a - b).max() / np.abs(b - c).max() < 4.2


@pytest.mark.slow
def test_a_row_that_rubs_leaves_the_laws_of_others_alone():
    """Beside it a row that yields, damped by a linear damper: each as it is alone."""
    phi = np.zeros((4, 8))
    phi[:3, :4], phi[3, 4:] = ALONG_AND_ACROSS, PHI[0]
    omega, zeta, point = np.tile(OMEGA, 2), np.tile(ZETA, 2), np.array([0, 0, 0, 1])
    behind = space.Structure(omega, zeta, phi, point, np.vstack([AXES, RIGHT]), np.zeros((2, 2)))
    law = tangential_law(0.2, *STEEL_ON_STEEL)
    rubbing, other = chain(3), chain(3, dissipation="linear", gamma=2.0)
    other = other._replace(yield_overlap=np.full(3, 5e-7))
    last = LastSphere(law, 0.4 * float(rubbing.mass[-1]) * R**2, np.zeros(2))
    first = space.Row(rubbing, striking(3, 0.3), np.zeros(3), AXES[0], last=last)
    second = space.Row(other, striking(3, 0.3), np.zeros(3), RIGHT)
    run = {"duration": 2e-4, "error": 1e-4, "n_save": 50}

    def march(rows, structure):
        rows = space.rows_of(rows, structure)
        found = space.march_to_error(rows.packing, structure, rows.velocity, **run)
        return space.row_runs(rows, structure, found)

    together = march([first, second], behind)
    one = space.Structure(OMEGA, ZETA, phi[:3, :4], point[:3], AXES, np.zeros((1, 2)))
    two = space.Structure(OMEGA, ZETA, phi[3:, 4:], point[:1], RIGHT[None], np.zeros((1, 2)))
    for i, (row, structure) in enumerate(((first, one), (second, two))):
        (alone,) = march([row], structure)
        assert np.abs(together[i].v - alone.v).max() < 2e-4 * 0.3
    assert together[0].across.friction_force.any() and together[1].across is None


def test_rows_that_rub_state_their_errors_and_close_their_ledgers():
    """Beside marches by an eighth of the step with four times the cells."""
    for seed in (3, 4, 5):
        rows, behind = random_rubbing_rows(seed)
        run = {"duration": 2e-4, "n_save": 100}
        mine = space.march_to_error(rows.packing, behind, rows.velocity, error=1e-4, **run)
        cells = rows.packing.springs._replace(n_cells=1024)
        fine = space.march(
            rows.packing._replace(springs=cells), behind, rows.velocity, dt=mine.dt / 8, **run
        )
        speed = np.linalg.norm(rows.velocity, axis=1).max()
        true = np.linalg.norm(mine.velocity - fine.velocity, axis=2).max() / speed
        assert true < mine.error_estimate < 1e-4
        assert mine.energy_error < 2e-5
        # the heat of a contact never falls
        assert (np.diff(mine.friction_heat, axis=0) >= 0.0).all()


@pytest.mark.parametrize(
    ("last", "words"),
    [
        ({"inertia": 0.0}, "row: inertia"),
        ({"arm_stiffness": np.array([-1.0, 0.0])}, "row: arm_stiffness"),
        ({"before": tangential_law(0.1, R, E, NU, R, E, NU)}, "row: friction between spheres"),
        ({"velocity": np.array([0.1, 0.0]), "arm_stiffness": np.full(2, np.inf)}, "row: the arm"),
    ],
)
def test_last_spheres_out_of_range_are_refused(last, words):
    behind = space.Structure(
        OMEGA, ZETA, ALONG_AND_ACROSS, np.zeros(3, np.int64), AXES, np.zeros((1, 2))
    )
    given = {"inertia": 1e-6, "velocity": np.zeros(2)} | last
    sphere = LastSphere(tangential_law(0.2, *STEEL_ON_STEEL), **given)
    with pytest.raises(dem.InvalidChain, match=words):
        space.rows_of(
            [space.Row(chain(1), striking(1, 0.1), np.zeros(3), AXES[0], last=sphere)], behind
        )


def test_friction_needs_three_directions_of_the_structure():
    behind = structure(PHI[:1], OMEGA, ZETA, SERIES[:1])
    sphere = LastSphere(tangential_law(0.2, *STEEL_ON_STEEL), 1e-6, np.zeros(2))
    with pytest.raises(dem.InvalidChain, match="takes three directions"):
        space.rows_of(
            [space.Row(chain(2), striking(2, 0.1), np.zeros(3), LEFT, last=sphere)], behind
        )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"exponent": np.full(3, 1.5)}, "a law other than Hertz'"),
        ({"friction": np.full(3, 0.1)}, "friction of guides"),
    ],
)
def test_rows_of_laws_that_are_not_marched_are_refused(fields, words):
    behind = structure(PHI, OMEGA, ZETA, SERIES)
    with pytest.raises(dem.InvalidChain, match=words):
        rows_on([chain(3)._replace(**fields)], [striking(3, 0.1)], (0.0,), behind)


def test_contacts_that_the_structure_does_not_answer_are_refused():
    with pytest.raises(dem.InvalidChain, match="the point 1 of a structure that has 1"):
        behind = structure(PHI[:1], OMEGA, ZETA, SERIES[:1])
        two = structure(PHI, OMEGA, ZETA, SERIES)
        rows = rows_on([chain(3)] * 2, [striking(3, 0.1)] * 2, (0.0, 0.0), two)
        space.march(rows.packing, behind, rows.velocity, duration=1e-4, dt=1e-6)
