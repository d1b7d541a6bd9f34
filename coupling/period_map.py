"""Fixed points of a period map: states that a period of the shakers brings back.

A march of one period maps the state z of the bodies at its start to Phi(z); the contact keeps what
the period leaves in it. Newton's method finds its fixed point,

    z <- z + s,    (1 - J) s = Phi(z) - z,    J d = (Phi(z + e d) - Phi(z)) / e

with s from a few directions d, each (1 - M)^-1 times what is left of the equation (generalised
conjugate residuals: S. C. Eisenstat, H. C. Elman, M. H. Schultz, SIAM J. Numer. Anal. 20 (1983)
345). M = exp(A T) is the period map of the linear system with the contact's mean stiffness and
damping over a cycle, corrected by each J d (Broyden). The level of the shakers rises in steps, each
from the state of the one before: no cycle on the way is much larger than the last one, whose slip
wipes out what smaller ones left (Madelung's rules). Slip that reaches only part of the contact
leaves the rest as it was; the state is that of a contact that was never sheared before.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from beadwave.dem import UnstableStep
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.richardson import richardson


class PeriodicSearch(NamedTuple):
    """Search for a periodic state."""

    cycle_steps: int = 1024  # of a period, at least
    cycle_saves: int = 256  # instants of a period that are kept
    phase: float = 0.25  # of the fastest contact in a step, at most; not varied
    levels: tuple[float, ...] = (0.25, 0.5, 0.75)  # of the shakers' forces, before all of them
    settling: int = 10  # periods of all their forces before Newton's first step
    most_iterations: int = 12  # Newton steps; after these periods are marched one by one
    directions: int = 20  # of a Newton step, at most
    linear: float = 0.05  # of a Newton step's equation that may be left
    most_periods: int = 200  # marched one by one; after these there is no periodic state
    periodicity: float = 0.01  # change of state and forces from period to period, over the error
    gained: float = 0.1  # of the change: energy that the bodies gain over the shakers' work
    # change below which a state counts as periodic that does not come nearer, over the error; of a
    # contact that opens: one whose change of 0.35 was accepted was wrong by 1.6 times the error
    accepted: float = 1.0
    opening: float = 0.25
    subharmonics: int = 4  # periods after which a state may come back
    nudge: float = 1e-5  # e |d| over |z|, both by their energy; not varied
    refined: float = 2.0  # steps of a period over those before, until the error is met
    share: float = 0.5  # of the error, for the steps of a period
    most_steps: float = 1e5  # of a period
    # of the error by steps four times as long: where more is left, the search ends; theory says a
    # quarter or less. In two trials of `stability` that are refused it rose from there on
    hopeless: float = 0.5

    # by harmonic balance
    samples: float = 5.0  # over a period of the fastest contact, at first
    cells: int = 32  # of the contact in two directions, at first; samples and cells are doubled
    most_samples: int = 2**15
    # of the error, speed by which unbalanced forces let bodies swing where the harmonic next to the
    # resonance of arm and contact lies half a harmonic off it; a twentieth of one off it, the swing
    # is as large as the error
    swing: float = 0.1
    creep: float = 0.1  # change of the tangential force over a period, over the error
    # cells that the error of a cycle's heat is taken from, along its path: where little slips,
    # that is a ring narrower than a cell, and to 64 of them all sticks
    ring_cells: int = 1024  # at least, and twice those of the cycle; 8192 say the same to 12 %
    # of other starts, which give the range of mean forces: pushes over gross slip, from 1 on all
    # slips; change of a cycle; creep in two directions. Not varied
    pushed: float = 2.0
    pushed_change: float = 1e-4
    pushed_creep: float = 1e-3
    # of the largest tangential force: what periods marched by two steps may leave of a cycle after
    # the square of the step is taken off; or twice the error, if that is more
    proven: float = 5e-3


USUAL_PERIODIC_SEARCH = PeriodicSearch()


class Moving(Protocol):
    """Bodies and contacts, changed in place by marches."""

    def copied(self) -> Self:
        """A copy in arrays of its own."""


class Saved(Protocol):
    """States saved over a period at k instants, a named tuple of arrays (k, ...)."""

    x: Array  # [m] of the spheres along their chains
    v: Array  # [m/s]
    force: Array  # [N] of the contacts at the wall
    stick: Array  # share of the contacts' areas


class PeriodMap(Protocol):
    """Marches of whole periods by equal steps; states z are of 2 m numbers, displacements from rest
    and velocities."""

    @property
    def rate(self) -> float:
        """[rad/s] of the fastest contact."""

    def march(self, moving: Any) -> Any:
        """A period on, in place, and what it saves. Raises UnstableStep."""

    def place(self, moving: Any, z: Array, *, sheared: bool = True) -> None:
        """Bring the bodies to z (2 m,), in place, and the contacts with them; or with their shear
        as it is.

        Where all of a contact slips within the cycle, the cycle sets its shear anew, and to shear
        it further or back from where it slips would make a kink of the period map.
        """

    def z_of(self, moving: Any) -> Array:
        """The bodies' displacements from rest and velocities, (2 m,)."""

    def linear(self, saved: Any) -> tuple[Array, Array]:
        """Period map M (2 m, 2 m) of the linear system, and weights (2 m,) with which
        sum (weight z)^2 is twice the energy, of the stiffness its diagonal alone; contacts across
        as in the cycle saved last, None: as they stick."""

    def at_level(self, level: float) -> Self:
        """The map with the shakers' forces times `level`."""

    def work_scale(self, saved: Any) -> float:
        """[J] Work of the shakers in a cycle, or a tenth of what tangential forces do over slip if
        both are in phase: of contacts that all but stick, work and losses are next to rounding."""

    def speeds_of(self, saved: Any) -> Array:
        """(k, n) [m/s] of all bodies and points of the wall over a cycle."""


class FixedPoint(NamedTuple):
    """A state that a period brings back, and the cycle that does."""

    moving: Moving
    saved: Saved
    change: float  # of state and forces in the period, over their largest
    jacobian: Array  # (2 m, 2 m) of the period map, in units of energy^(1/2)


def risen(period: PeriodMap, moving: Moving, search: PeriodicSearch) -> Saved | None:
    """The last period of `moving`, which is brought from rest near its periodic state by shakers
    whose level rises; None where nothing was marched."""
    saved, level_before = None, 0.0
    for level in search.levels:
        lower = period.at_level(level)
        z = period.z_of(moving) * (level / level_before if level_before else 1.0)
        for _ in range(2):
            lower.place(moving, z)
            saved = lower.march(moving)
            M, weights = period.linear(saved)
            z = z + step_of(M, weights, period.z_of(moving) - z)
        lower.place(moving, z)
        level_before = level
    if search.levels:
        period.place(moving, period.z_of(moving) / level_before)
    for _ in range(search.settling):
        saved = period.march(moving)
    return saved


def fixed_point(
    period: PeriodMap,
    moving: Moving,
    search: PeriodicSearch,
    tolerance: float,
    jacobian: Array | None = None,
) -> FixedPoint:
    """A state that a period brings back; its change is above the tolerance where none is found.

    Starts from `moving`, at rest unless the Jacobian (2 m, 2 m) of a search before is given. Raises
    UnstableStep where a period on the way is not finite.
    """
    saved = risen(period, moving, search) if jacobian is None else None
    z = period.z_of(moving)
    if saved is None:
        saved = period.march(moving.copied())
    sheared = bool(saved.stick.min() > 0.0)
    M, weights = period.linear(saved)

    # unknowns in units of energy^(1/2): displacements of stiff springs and of soft ones weigh alike
    units = np.where(weights > 0.0, weights, 1.0)
    moves = weights > 0.0

    def scaled_step(J: Array, residual: Array) -> Array:
        """(1 - J)^-1 residual (2 m,), both in units of energy^(1/2)."""
        out = np.zeros(len(J))
        matrix = (np.eye(len(J)) - J)[np.ix_(moves, moves)]
        if neutral:
            out[moves] = np.linalg.lstsq(matrix, residual[moves], rcond=1e-10)[0]
        else:
            out[moves] = np.linalg.solve(matrix, residual[moves])
        return out

    J = units[:, None] * M / units if jacobian is None else jacobian.copy()
    sizes = np.linalg.svd((np.eye(len(J)) - J)[np.ix_(moves, moves)], compute_uv=False)
    neutral = bool(sizes[-1] < 1e-8 * sizes[0])  # a motion that comes back of itself
    best, error, result = math.inf, math.inf, None
    size = math.inf
    step = np.zeros(len(z))
    for _ in range(search.most_iterations):
        # a period; a Newton step that leads further away is cut back
        for cut_back in range(4):
            period.place(moving, z, sheared=sheared)
            start = moving.copied()
            saved = period.march(moving)
            image = period.z_of(moving)
            residual = units * (image - z) * moves
            if np.linalg.norm(residual) <= 1.5 * size or cut_back == 3:
                break
            step = 0.5 * step
            z = z - step
            moving = start

        # what the period has changed: bodies by their energy, forces at the wall, energy gained
        size = float(np.linalg.norm(residual))
        scale = float(np.abs(saved.force).max()) or 1.0
        error = size / (float(np.linalg.norm(units * image * moves)) or 1.0)
        error = max(error, float(np.abs(saved.force[-1] - saved.force[0]).max()) / scale)
        # what the bodies gain over the shakers' work: their energy may be much larger than that
        gained = 0.5 * abs(np.sum(residual * (units * (image + z) * moves)))
        work = period.work_scale(saved)
        error = max(error, search.gained * gained / work if work else 0.0)
        if error < best:
            best, result = error, (moving.copied(), saved)
        if error <= tolerance:
            break

        # Newton's equation by directions d and what they change it by, (1 - J) d
        length = search.nudge * float(np.linalg.norm(units * z * moves))
        D, E, remaining = [], [], residual
        for _ in range(search.directions):
            d = scaled_step(J, remaining)
            norm = float(np.linalg.norm(d))
            if not norm > 0.0:
                break
            d = d / norm
            neighbour = start.copied()
            period.place(neighbour, z + length * d / units, sheared=sheared)
            period.march(neighbour)
            change = units * (period.z_of(neighbour) - image) * moves / length
            J += np.outer(change - J @ d, d)
            D.append(d)
            E.append(d - change)
            share = np.linalg.lstsq(np.array(E).T, residual, rcond=None)[0]
            remaining = residual - np.array(E).T @ share
            if np.linalg.norm(remaining) <= search.linear * size:
                break
        if not D:  # what is left moves along motions that come back of themselves
            break
        step = np.array(D).T @ share / units
        z = z + step
    moving, saved = (moving, saved) if result is None else result
    return FixedPoint(moving, saved, best, J)


def step_of(M: Array, weights: Array, residual: Array) -> Array:
    """(1 - M)^-1 residual (2 m,), of M and weights (2 m,) as of `PeriodMap.linear`; the least one
    where a motion comes back of itself: of spheres that are held, or roll on the wall."""
    units = np.where(weights > 0.0, weights, 1.0)
    moves = weights > 0.0
    matrix = (np.eye(len(M)) - M) * units[:, None] / units
    z = np.zeros(len(M))
    z[moves] = np.linalg.lstsq(
        matrix[np.ix_(moves, moves)], (units * residual)[moves], rcond=1e-10
    )[0]
    return z / units


def stays(period: PeriodMap, state: Moving, search: PeriodicSearch) -> bool:
    """True if the state is stable: a neighbouring one stays within three times its distance, by
    energy, over `search.subharmonics` periods."""
    moving = state.copied()
    z = period.z_of(moving)
    weights = period.linear(None)[1]
    neighbour = z * (1.0 + search.nudge * np.cos(np.arange(len(z))))
    distance = np.linalg.norm(weights * (neighbour - z))
    period.place(moving, neighbour)
    for _ in range(search.subharmonics):
        period.march(moving)
    return bool(np.linalg.norm(weights * (period.z_of(moving) - z)) < 3.0 * distance)


def marched_on(
    period: PeriodMap, moving: Moving, speed: float, search: PeriodicSearch, tolerance: float
) -> tuple[Moving, Saved, float, int]:
    """The state after periods one by one, its cycle, the change from cycle to cycle, and after how
    many periods it comes back. Raises UnstableStep where it does not.

    The change is the largest of forces over the largest force, and of spheres along the chain over
    `speed` [m/s] or the fastest body: of their velocities, and of their displacements times the
    rate of the fastest contact, which is what a gap changes velocities by when it closes. Forces
    alone call any flight without contact periodic: 5e-7 m of gap left 5 % of the velocities open.
    """
    recent: list[Saved] = []
    rate = period.rate
    for _ in range(search.most_periods):
        recent = [*recent[-2 * search.subharmonics + 1 :], period.march(moving)]
        scale = max(float(np.abs(saved.force).max()) for saved in recent) or 1.0
        fastest = (
            max(speed, *(float(np.abs(period.speeds_of(saved)).max()) for saved in recent)) or 1.0
        )
        once = math.inf  # change after one period
        for m in range(1, min(search.subharmonics, len(recent) // 2) + 1):
            pairs = [(recent[-1 - i], recent[-1 - i - m]) for i in range(m)]
            of_forces = max(float(np.abs(a.force - b.force).max()) for a, b in pairs) / scale
            of_speeds = max(float(np.abs(a.v - b.v).max()) for a, b in pairs) / fastest
            of_places = max(float(np.abs(a.x - b.x).max()) for a, b in pairs) * rate / fastest
            change = max(of_forces, of_speeds, of_places)
            once = change if m == 1 else once
            if change <= tolerance and (m == 1 or change < 0.01 * once):
                return moving, joined(recent[-m:]), change, m
    still_changing = (
        f"the force at the wall still changes by {of_forces:.1g} of its largest"
        if of_forces > tolerance
        else "the spheres do not come back to where they were"
    )
    raise UnstableStep(
        f"the shakers lead to no periodic state within {search.most_periods} periods: "
        f"{still_changing}; hold the sphere by [arm], press it harder, or change the shakers"
    )


def joined(cycles: list[Saved]) -> Saved:
    """Cycles one after the other, the instant between two of them once."""
    return type(cycles[0])(
        *(
            np.concatenate([values if i == 0 else values[1:] for i, values in enumerate(parts)])
            for parts in zip(*cycles, strict=True)
        )
    )


class PeriodicCycle(NamedTuple):
    """A periodic state found by steps of one length, and its last cycle."""

    period: PeriodMap
    moving: Moving
    saved: Saved
    point: FixedPoint | None  # of Newton's method, with which the next search begins
    change: float  # from cycle to cycle, over the largest
    n_periods: int  # of the shakers until it comes back
    impacting: bool  # contacts open in it


class CycleNumbers(NamedTuple):
    """Numbers by which two cycles are compared."""

    speeds: Array  # of all bodies at the instants saved, over the largest
    amplitudes: Array  # logarithms of those of friction and slip at each contact
    heat: float  # of friction, over the shakers' work
    loops: Array  # (m,) [J] of friction in each contact: may be small against that work

    def difference(self, other: "CycleNumbers") -> float:
        """Largest of all but the loops'."""
        pairs = zip(self[:-1], other[:-1], strict=True)
        return max(float(np.abs(a - b).max(initial=0.0)) for a, b in pairs)


def settled(
    period: PeriodMap,
    begin: Moving,
    point: FixedPoint | None,
    opens: Callable[[Saved], bool],
    speed: float,
    error: float,
    search: PeriodicSearch,
) -> PeriodicCycle:
    """The state at a fixed point; where its change is above the error, or its contacts open and it
    is not stable, the state after periods marched one by one from it, from `begin` where `point` is
    None. Raises UnstableStep as `marched_on`."""
    moving, change, impacting, n_periods = begin, math.inf, False, 1
    if point is not None:
        moving, saved, change = point.moving, point.saved, point.change
        impacting = opens(saved)
    accepted = (search.opening if impacting else search.accepted) * error
    if change > accepted or (impacting and not stays(period, moving, search)):
        moving, saved, change, n_periods = marched_on(period, moving, speed, search, accepted)
    return PeriodicCycle(period, moving, saved, point, change, n_periods, impacting)


def refined(
    found: Callable[[int, int, PeriodicCycle | None], PeriodicCycle],
    numbers_of: Callable[[PeriodicCycle], CycleNumbers],
    n_steps: int,
    n_cells: int,
    error: float,
    order: float,
    search: PeriodicSearch,
) -> tuple[PeriodicCycle, float, Array]:
    """The cycle by steps so short, and contacts of so many cells, that it is right to the error;
    what is left of it, by `order` of the step; and the error of each loop [J].

    Steps and cells are doubled, each search, found(n_steps, n_cells, cycle before), from the state
    of the one before. Raises UnstableStep for a period of too many steps, where shorter steps do
    not help, and where two searches come back after different numbers of periods.
    """
    most = search.most_steps / search.refined
    if n_steps > most:
        raise UnstableStep(
            f"a period of the shakers is {n_steps:.1e} steps of the fastest contact long, at most "
            f"{most:.1e} are marched; raise their frequency, or press the contacts less"
        )
    cycle, coarse, estimates = None, None, [math.inf]
    while True:
        cycle = found(n_steps, n_cells, cycle)
        numbers = numbers_of(cycle)
        # the error by the search before, if both come back after as many periods
        estimate, loop_errors = math.inf, np.full(np.shape(numbers.loops), np.inf)
        if coarse is not None and coarse.speeds.shape == numbers.speeds.shape:
            estimate = richardson(numbers.difference(coarse), search.refined, order)
            loop_errors = richardson(np.abs(numbers.loops - coarse.loops), search.refined, order)
        estimates.append(estimate)
        if estimate <= search.share * error or (coarse is not None and cycle.n_periods > 1):
            break
        stuck = len(estimates) > 3 and estimate > search.hopeless * estimates[-3]
        if stuck or n_steps * search.refined > search.most_steps:
            why = ", and shorter steps do not help" if stuck else ""
            raise UnstableStep(
                f"the periodic state changes by {estimate:.1g} of its speeds at {n_steps} steps a "
                f"period{why}; ask for a larger error"
            )
        coarse, n_steps, n_cells = numbers, math.ceil(n_steps * search.refined), 2 * n_cells
    if not math.isfinite(estimate):
        raise UnstableStep(
            f"the state comes back after {cycle.n_periods} periods of the shakers, and by other "
            "steps after another number: its error is unknown; change the shakers"
        )
    return cycle, estimate, loop_errors
