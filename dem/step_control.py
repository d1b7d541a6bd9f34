"""The step from the error asked for: march twice with different steps and compare.

    e  ~  |v_h - v_H| / ((H/h)^p - 1)

is the error of the finer of two marches of steps h < H whose error falls with order p (L. F.
Richardson; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed.,
sec. II.4). Contacts that open and close lower the order that a scheme has on smooth forces, so p is
assumed low, and what the differences of three marches show is believed up to a limit.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.between import run_between
from dem.chain import Chain, State, validate
from dem.checks import columns, positive, saves
from dem.kernels.arguments import Array
from dem.prepared import prepare
from dem.schemes import SCHEMES, Scheme
from dem.stability import (
    UnstableStep,
    fastest_decay,
    fastest_rate,
    marching_scheme,
    stability_interval,
)
from dem.trajectory import Trajectory, march, run, start
from dem.walls import Wall

EPSILON = float(np.finfo(float).eps)


class StepReport(NamedTuple):
    """How a step was found: one entry per comparison of two marches, coarse to fine."""

    dt: Array  # [s] of the finer march
    difference: Array  # relative velocity change against the coarser march
    energy_error: Array
    error_estimate: float
    evaluations: int  # contact force evaluations of all marches


class Controlled(NamedTuple):
    """A march and the report on its step."""

    trajectory: Trajectory
    step_report: StepReport


class StepSearch(NamedTuple):
    """How the step of a march to an error is searched for: three wishes, then tuned numbers.

    The ranges in which the tuned ones were tried are not on record; `examples/cost_of_error.py`
    prints what a change does to stated errors and costs.
    """

    scheme: str | None = None  # None: what suits the chain
    energy_error: float | None = None  # to which the ledger closes; None: error / 100
    max_evaluations: float | None = None  # of all contacts; None: what takes about a minute

    # steps H of the coarser march over those h of the finer one
    first_ratio: float = 4.0  # of the first pair
    rough_ratio: float = 2.0  # of the first pair of an implicit scheme where forces jump
    clear_ratio: float = 2.5  # beyond it the order that a pair shows scatters less
    largest_ratio: float = 6.0  # bounds of H/h where the energy error of the first march sets h
    smallest_ratio: float = 1.4
    longest_leap: float = 8.0  # the next step is at most so many times shorter

    # orders p by which velocity errors are taken to fall
    pair_order: float = 1.5  # one pair of marches close together; before a dashpot also of more
    highest_order: float = 2.0  # any number of marches
    yield_order: float = 1.25  # contacts that yield: stiffnesses jump
    jump_order: float = 0.75  # the linear dampers: forces jump
    clear_order: float = 2.5  # a first pair of clear_ratio, smooth forces
    clear_yield_order: float = 1.5  # the same, contacts that yield
    caution: float = 0.5  # taken off the order observed in three marches, which scatters

    # margins
    energy_margin: float = 2.0  # energy errors scatter by as much from step to step
    velocity_margin: float = 1.6  # in the velocity error that the next step aims at
    first_jump: float = 1.5  # times a first difference where forces jump: no other confirms it

    # rounding
    ledger_ulps: float = 4.0  # of its largest entry that the sum of a ledger may be off by
    rounding_walk: float = 3.0  # times sqrt(evaluations) eps, of rounding in a ledger
    amplification: float = 1e5  # so many times rounding is a difference that the motion made of it
    # by which two differences that rounding makes may differ: an estimate takes so many times the
    # larger one, and a difference that falls by more is none of rounding
    chance: float = 3.0
    rounding_excess: float = 30.0  # times the error that rounding may reach: it rarely all adds up

    # when to give up
    # share of the evaluations allowed, some seconds, after which, or once rounding is amplified,
    # the search goes on only if it gets nearer
    patience: float = 1 / 6
    slowest_order: float = 0.25  # order of the excess below which it gets no nearer
    damper_energy: float = 0.05  # of the energy, that two ways to damp may differ by


USUAL_SEARCH = StepSearch()


class _MarchPair(NamedTuple):
    """A march compared with a coarser one."""

    dt: float  # [s]
    coarse_dt: float  # [s]
    difference: float  # largest of the velocities, over the scale
    energy_error: float
    estimate: float  # of the velocity error of the finer march
    velocity: float  # that estimate over the error asked for
    excess: float  # the larger of velocity and energy, each over what is asked for
    shorter: float  # so many times shorter is a step that is likely to do
    amplified: bool  # whether the difference is what the motion makes of rounding


def march_to_error(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    *,
    duration: float,
    error: float,
    observed: Sequence[int] | None = None,
    n_save: int = 1000,
    search: StepSearch = USUAL_SEARCH,
) -> Controlled:
    """Trajectory whose velocities are off by less than `error` times the largest initial speed on
    the observed spheres (indices, None for all).

    The first march is compared with one of steps about four times as long, whose energy error sets
    its own step; where its ledger closes too little, a finer march is compared with the same. The
    estimate divides the difference of two marches by (H/h)^p - 1, with an order p that is lower
    than that of the schemes, which they do not keep at every step:

        of a first pair far apart      2.5; 1.5 for contacts that yield
        of a first pair close together 1.5
        of three marches and more      the order observed, at most 2; 1.5 before a dashpot,
                                       1.25 for contacts that yield, 0.75 for linear dampers

    Linear dampers let forces jump: there the last two differences count. Raises UnstableStep where
    the evaluations allowed do not suffice.
    """
    validate(chain, wall, v0)
    positive("error", error)
    positive("duration", duration, " s")
    saves(n_save, chain.mass.size)
    for name in ("energy_error", "max_evaluations"):
        if getattr(search, name) not in (None, np.inf):
            positive(name, getattr(search, name))

    prepared = prepare(chain, wall)
    rate = max(fastest_rate(prepared, v0), 1.0 / duration)
    method = marching_scheme(prepared, v0, 1.0 / (3.0 * rate), search.scheme)
    implicit = method.kind == "implicit"
    state = start(prepared, v0)

    # what is asked: both errors, and how many evaluations of the contact forces may be spent
    energy_error = search.energy_error or max(1e-2 * error, 1e-12)
    allowed = search.max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)
    allowed = allowed / 20 if implicit else allowed  # Newton iterations
    observed = columns(observed, chain.mass.size)
    speed = float(np.abs(v0).max()) or 1.0
    highest_order = _assumed_order(chain, wall, method, search)
    decay = fastest_decay(prepared, state.v) if implicit else 0.0

    def attempt(step, n_save):
        """The march by steps up to `step`, None where it is unstable."""
        try:
            return run_between(prepared, state, duration, step, method, n_save)
        except UnstableStep:
            return None

    # first step: light wall modes make contacts stiff for stability, not for the accuracy of their
    # solution, so the period is that of the contacts before a rigid wall
    rigid_rate = max(fastest_rate(prepared._replace(wall=None), v0), 1.0 / duration)
    step = min(_first_step(method, error, energy_error) / rigid_rate, duration)

    # first coarse march, saved at instants that the fine one shares: the largest divisor of n_save
    # that is no more than its steps, n_save if there is none
    rough = highest_order < search.pair_order  # forces or stiffnesses jump
    longer = search.rough_ratio if implicit and rough else search.first_ratio
    spent = duration / (longer * step) * method.evaluations
    if not spent <= allowed:
        raise UnstableStep(
            f"error {error:g} over {duration:g} s is not reached within {allowed:.2g} evaluations, "
            f"it takes more than {spent:.2g} at dt = {step:.3g} s; ask for a larger error or less "
            "time"
        )
    n_coarse = duration / (longer * step) * (1 + 1e-9)
    divisors = (n_save // k for k in range(1, 51) if n_save % k == 0)
    coarse = attempt(longer * step, next((m for m in divisors if m <= n_coarse), n_save))

    # the ledger of the coarse march sets the first step. Steps that end at the saves may be the
    # same for both marches where a save takes few of them: ask for a shorter one
    if coarse is not None and implicit:
        step = min(step, coarse.dt / search.smallest_ratio)
    elif coarse is not None:
        excess = _energy_excess(coarse, method, energy_error, search)
        shorter = _shorter_for_energy(excess, method, highest_order, search)
        smallest = search.smallest_ratio if np.isfinite(energy_error) else 2.0
        step = coarse.dt / float(np.clip(shorter, smallest, search.largest_ratio))

    pairs = []
    while True:
        # refuse a march that rounding makes futile, that costs too much, or that gets no nearer
        ahead = duration / step * method.evaluations
        rounding = EPSILON * duration / step * method.evaluations
        if rounding > search.rounding_excess * error:
            raise UnstableStep(lost_in_rounding(error, rounding, step))
        hopeless = spent + ahead > allowed
        late = spent + ahead > search.patience * allowed
        if not hopeless and len(pairs) >= 2 and (late or pairs[-1].amplified):
            # falling on as it did last, the excess has to be gone within the evaluations allowed
            previous, last = pairs[-2:]
            order = np.log(previous.excess / last.excess) / np.log(previous.dt / last.dt)
            possible = allowed / (duration / last.dt * method.evaluations)
            nears = order > search.slowest_order and last.excess ** (1.0 / order) <= possible
            hopeless = not nears
        if hopeless:
            result = "no march that stays finite (a negative residual compliance may be too large)"
            if pairs:
                last = pairs[-1]
                result = f"{last.estimate:.3g} in velocity, {last.energy_error:.3g} in energy"
            raise UnstableStep(
                f"error {error:g} is not reached with dt = {step:.3g} s, found {result}; "
                "ask for a larger error or allow more evaluations"
            )

        fine = attempt(step, n_save)
        spent += ahead if fine is None else fine.n_steps * method.evaluations
        if fine is None or coarse is None:
            step = step / 4.0 if fine is None else min(step / 2.0, fine.dt / search.smallest_ratio)
            coarse = fine
            continue

        difference, estimate, amplified = _richardson(
            coarse, fine, pairs, method, highest_order, observed, speed, search
        )
        velocity = estimate / error
        energy = _energy_excess(fine, method, energy_error, search)

        # implicit marches whose steps do not resolve the dampers may all be wrong in the same way:
        # compare the work of the dampers with what they do one by one, each exactly ("verlet")
        unresolved = implicit and prepared.damping is not None and fine.dt * decay >= 1.0
        if unresolved and max(velocity, energy) <= 1.0:
            try:
                verlet = run(prepared, state, fine.t[-1], fine.dt, SCHEMES["verlet"], 1)
                work = abs(verlet.dissipated_contact[-1] - fine.dissipated_contact[-1])
            except UnstableStep:
                work = np.inf
            velocity = max(velocity, work / fine.energy_scale / search.damper_energy)

        # the next step, likely to do: velocities fall by three quarters of the order that the
        # scheme has on smooth forces, however low the one that the estimate takes
        likely = 1.25 if rough else max(highest_order, 0.75 * min(method.order, 4))
        shorter = 1.15
        if velocity > 1.0:
            shorter = (search.velocity_margin * velocity) ** (1.0 / likely)
        shorter = max(shorter, _shorter_for_energy(energy, method, highest_order, search))
        shorter = min(shorter, search.longest_leap)
        pairs.append(
            _MarchPair(
                fine.dt, coarse.dt, difference, fine.energy_error, estimate, velocity,
                max(velocity, energy), shorter, amplified,
            )
        )  # fmt: skip
        if pairs[-1].excess <= 1.0:
            break
        coarse = fine if velocity > 1.0 else coarse
        step = fine.dt / shorter

    report = StepReport(
        np.array([pair.dt for pair in pairs]),
        np.array([pair.difference for pair in pairs]),
        np.array([pair.energy_error for pair in pairs]),
        estimate,
        int(spent),
    )
    return Controlled(fine._replace(error_estimate=estimate), report)


def with_step_error(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    trajectory: Trajectory,
    *,
    state: State | None = None,
) -> Trajectory:
    """The trajectory of a given step, its relative velocity error estimated by half the step.

    The estimate is cautious like that of `march_to_error`, on all spheres; `state` is what the
    trajectory continued, if it did.
    """
    finer = march(
        chain, wall, v0, duration=float(trajectory.t[-1]), dt=trajectory.dt / 2.0,
        scheme=trajectory.scheme, n_save=trajectory.t.size - 1, state=state,
    )  # fmt: skip
    speed = float(np.abs(v0).max()) or 1.0
    difference = _velocity_difference(trajectory, finer, np.arange(chain.mass.size), speed)
    order = _assumed_order(chain, wall, SCHEMES[trajectory.scheme], USUAL_SEARCH)
    return trajectory._replace(error_estimate=difference / (1.0 - 0.5**order))


def lost_in_rounding(error: float, rounding: float, dt: float) -> str:
    """Sentence on an error that no step [s] reaches, because rounding alone leaves more."""
    return (
        f"error {error:g} is not reached, rounding alone leaves up to {rounding:.2g} with "
        f"dt = {dt:.3g} s; ask for a larger error or less time"
    )


def _richardson(coarse, fine, pairs, method, highest_order, observed, speed, search):
    """Largest difference of the velocities of two marches over the speed, the error of the finer
    one estimated by it, and whether the difference is what the motion makes of rounding.

    `pairs` are the comparisons before this one, `highest_order` is what an observed order is
    believed up to.
    """
    difference = _velocity_difference(coarse, fine, observed, speed)

    # order p: that of one pair may be small by chance, or because both steps are too long to show
    # an order, so it is assumed; that of three marches is observed
    previous = next((pair for pair in reversed(pairs) if pair.coarse_dt > coarse.dt), None)
    order = min(search.pair_order, highest_order)
    if previous is not None:
        fall = np.log(previous.difference / difference) if difference > 0.0 else np.inf
        observed_order = fall / np.log(previous.coarse_dt / coarse.dt) - search.caution
        order = float(np.clip(observed_order, order, highest_order))
    elif coarse.dt > search.clear_ratio * fine.dt and highest_order == search.highest_order:
        order = search.clear_order
    elif coarse.dt > search.clear_ratio * fine.dt and highest_order == search.yield_order:
        order = search.clear_yield_order

    # e = |v_h - v_H| / ((H/h)^p - 1); where forces jump, two marches are alike by chance more
    # often, and the difference before counts too
    leading, jumps = difference, highest_order <= search.jump_order
    if jumps and previous is None:
        leading = search.first_jump * difference
    elif jumps:
        leading = max(difference, previous.difference * coarse.dt / previous.coarse_dt)
    estimate = leading / ((coarse.dt / fine.dt) ** order - 1.0)

    # Where the motion amplifies rounding no shorter step helps, and two marches are alike by
    # chance: the energy error stays at rounding while velocities differ by far more.
    # Implicit schemes close the ledger to rounding at any step, which says nothing. Where forces
    # jump the ledger may close so while velocities still converge, by their low order: there a
    # difference that falls by more than chance is none of rounding
    rounding = search.rounding_walk * EPSILON * np.sqrt(fine.n_steps * method.evaluations)
    stays = 0.5 * coarse.energy_error < fine.energy_error <= rounding
    far = rounding < difference / search.amplification
    falls = jumps and bool(pairs) and search.chance * difference < pairs[-1].difference
    amplified = bool(method.kind != "implicit" and stays and far and not falls)
    if amplified:
        estimate = search.chance * max([difference, *(pair.difference for pair in pairs[-1:])])
    return difference, estimate, amplified


def _velocity_difference(coarse, fine, observed, speed):
    """Largest difference of the observed velocities at the instants that both marches have saved,
    over the speed."""
    stride = (fine.t.size - 1) // (coarse.t.size - 1)
    return float(np.abs(fine.v[::stride] - coarse.v)[:, observed].max()) / speed


def _assumed_order(chain, wall, method, search):
    """Highest order that the differences of marches by a scheme are believed to show."""
    if chain.dissipation.startswith("linear"):
        return search.jump_order
    if chain.yield_overlap is not None:
        return search.yield_order
    if wall is not None and wall.mobility > 0.0:
        return search.pair_order
    return min(search.highest_order, method.order - 0.25)


def _energy_excess(run, method, energy_error, search):
    """Energy error of a march over the one asked for, or over what rounding leaves if that is more:
    of sums much larger than the motion, and of every part of every step."""
    largest = max(np.abs(entry).max() for entry in run.ledger)
    ulps = search.ledger_ulps * largest / run.energy_scale + run.n_steps * method.evaluations
    return run.energy_error / max(energy_error, EPSILON * ulps)


def _shorter_for_energy(excess, method, highest_order, search):
    """How many times shorter a step that is likely to close the ledger has to be."""
    order = min(method.order, 4.0 if highest_order >= search.pair_order else 3.0)
    return (search.energy_margin * excess) ** (1.0 / order)


def _first_step(method: Scheme, error: float, energy_error: float) -> float:
    """Step times contact frequency that reaches both errors on a chain of 17 spheres, with a
    margin of 3 (measured; a longer first step fools the estimate of chains of unlike spheres)."""
    if method.kind == "implicit":
        return 0.1 * (error / 5e-2) ** 0.5 if method.order == 2 else 0.2 * (error / 6e-5) ** 0.25
    bolder = {"rkn6": 1.2, "split4": 1.6}  # schemes that bear longer ones
    interval = stability_interval(method) * bolder.get(method.name, 1.0)
    if method.order == 2:
        return min(0.058 * min((error / 8e-3) ** 0.5, (energy_error / 5e-4) ** 0.5), 0.2 * interval)
    share = min((error / 3e-5) ** 0.25, (energy_error / 3e-6) ** 0.25)
    return interval * min(0.055 * share, 0.16)
