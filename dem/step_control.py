"""The step from the error asked for, by marching twice with different steps."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.between import run_between
from dem.chain import Chain, State, Wall, validate
from dem.checks import columns, positive, saves
from dem.kernels.arguments import Array
from dem.prepared import prepare
from dem.schemes import SCHEMES
from dem.stability import (
    UnstableStep,
    fastest_decay,
    fastest_rate,
    marching_scheme,
    stability_interval,
)
from dem.trajectory import Trajectory, march, run, start

FAR = 4.0  # times the step, of the march that the first is compared with
FAR_ENOUGH = 2.5  # times the step, beyond which the order that a pair shows scatters less
FARTHEST, NEAREST = 6.0, 1.4  # times the step, where the energy of that march says so
MARGIN = 2.0  # in the energy: its errors scatter by as much from step to step
BOLDER = {"rkn6": 1.2, "split4": 1.6}  # times longer first steps, of schemes that bear it
FIRST, MOST = 1.5, 2.0  # order that one pair of marches shows, and that any number of them does
JUMPS, YIELDS = 0.75, 1.25  # order that is left where forces jump, and where stiffnesses do
FAR_FIRST = {MOST: 2.5, YIELDS: 1.5}  # that a first pair shows that is far enough apart
BELOW = 0.5  # the observed order, which scatters
ALONE = 1.5  # of the first difference where forces jump: no other bears it out
EPSILON = float(np.finfo(float).eps)
ULPS = 4.0  # of the largest energy that a ledger's sum may be off by
SCATTER = 3.0  # times the root of its evaluations, of rounding in a ledger
AMPLIFIED = 1e5  # times as large is a difference that the motion has made of rounding
BY_CHANCE = 3.0  # of two differences that rounding makes
LOST = 30.0  # times the error asked for, that rounding may leave at the most: it rarely all adds up
QUICK = 1 / 6  # of the evaluations allowed, seconds: beyond, or where rounding is amplified, a
# search goes on if it gets nearer
SHARED = 0.05  # of the energy, that two ways to damp may differ by where steps resolve neither
SLOWEST = 0.25  # order below which it does not


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


class Search(NamedTuple):
    """How the step of a march to an error is searched for."""

    scheme: str | None = None  # None: what suits the chain
    energy_error: float | None = None  # to which the ledger closes; None: error / 100
    max_evaluations: float | None = None  # of all contacts; None: what takes about a minute


USUAL = Search()


def march_to_error(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    *,
    duration: float,
    error: float,
    observed: Sequence[int] | None = None,
    n_save: int = 1000,
    search: Search = USUAL,
) -> Controlled:
    """Trajectory whose velocities are off by less than `error` times the largest initial speed on
    the observed spheres (indices, None for all).

    The first march is compared with one of steps about four times as long, whose energy error sets
    its own step; where its ledger closes too little, a finer march is compared with the same. The
    estimate divides their difference by what order 2.5 leaves (1.5 for contacts that yield), that
    of marches less far apart by what order 1.5 does, of a third by what the observed order leaves,
    up to 2 (1.5 before a dashpot; 1.25 for contacts that yield; 0.75 for the linear laws, whose
    force does, where the last two differences count): all schemes here keep more, but not at every
    step. Raises UnstableStep where the evaluations allowed do not suffice.
    """
    validate(chain, wall, v0)
    positive("error", error)
    positive("duration", duration, " s")
    saves(n_save, chain.mass.size)
    scheme, energy_error, max_evaluations = search
    for name in ("energy_error", "max_evaluations"):
        if getattr(search, name) not in (None, np.inf):
            positive(name, getattr(search, name))
    prepared = prepare(chain, wall)
    rate = max(fastest_rate(prepared, v0), 1.0 / duration)
    method = marching_scheme(prepared, v0, 1.0 / (3.0 * rate), scheme)
    state = start(prepared, v0)
    allowed = max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)
    asked = _Asked(
        duration,
        n_save,
        error,
        energy_error or max(1e-2 * error, 1e-12),
        columns(observed, chain.mass.size),
        float(np.abs(v0).max()) or 1.0,
        _assumed_order(chain, wall, method),
        allowed / 20 if method.kind == "implicit" else allowed,
        _witness(prepared, state) if method.kind == "implicit" else None,
    )

    def attempt(step, saves):
        try:
            return run_between(prepared, state, duration, step, method, saves)
        except UnstableStep:
            return None

    # light wall modes make contacts stiff for stability, not for the accuracy of their solution
    rigid = max(fastest_rate(prepared._replace(wall=None), v0), 1.0 / duration)
    first = _first_step(method, error, asked.energy_error) / rigid
    return _refined(attempt, min(first, duration), method, asked)


class _Asked(NamedTuple):
    """What a march to an error is held to."""

    duration: float
    n_save: int
    error: float
    energy_error: float
    observed: Array
    scale: float
    order: float  # that the difference of two marches is taken to show
    evaluations: float
    witness: Callable | None  # what another way to damp says of a march, in shares of the energy


def _witness(prepared, state):
    """How far the work of a march's dampers is from what they do one by one, each exactly
    ("verlet"): steps that do not resolve them may all be wrong in the same way. 0 if they do."""
    decay = fastest_decay(prepared, state.v)

    def apart(found):
        if prepared.damping is None or found.dt * decay < 1.0:
            return 0.0
        try:
            other = run(prepared, state, found.t[-1], found.dt, SCHEMES["verlet"], 1)
        except UnstableStep:
            return np.inf
        off = other.dissipated_contact[-1] - found.dissipated_contact[-1]
        return abs(off) / found.energy_scale

    return apart


def _refined(attempt, step, method, asked):
    """The first march by finer and finer steps that is within what is asked."""
    duration, n_save, apart = asked.duration, asked.n_save, _apart(method, asked.order)
    spent = duration / (apart * step) * method.evaluations
    if not spent <= asked.evaluations:
        raise UnstableStep(_unaffordable(asked.error, duration, step, spent, asked.evaluations))
    coarse = attempt(apart * step, _sparser(n_save, duration / (apart * step)))
    # steps end at the saves: with few steps a save both marches may else take the same
    if coarse is not None and method.kind == "implicit":
        step = min(step, coarse.dt / NEAREST)
    elif coarse is not None:
        step = coarse.dt / _apart_for_energy(coarse, method, asked)
    tried = []
    while True:
        ahead = duration / step * method.evaluations
        _require_hope(step, spent + ahead, tried, method, asked)
        fine = attempt(step, n_save)
        spent += ahead if fine is None else fine.n_steps * method.evaluations
        if fine is None or coarse is None:
            step = step / 4.0 if fine is None else min(step / 2.0, fine.dt / NEAREST)
            coarse = fine
            continue
        tried.append(_compared(coarse, fine, tried, method, asked))
        if tried[-1].excess <= 1.0:
            break
        coarse = fine if tried[-1].velocity > 1.0 else coarse
        step = fine.dt / tried[-1].shorter
    compared = tuple(map(np.array, zip(*tried, strict=True)))[:3]
    estimate = tried[-1].estimate
    report = StepReport(*compared, estimate, int(spent))
    return Controlled(fine._replace(error_estimate=estimate), report)


def _apart(method, order):
    """How many times longer the steps of the march are that the first is compared with."""
    return FAR if order >= FIRST or method.kind != "implicit" else 2.0


def _apart_for_energy(coarse, method, asked):
    """The same, where the ledger of that march says what closes it as asked."""
    needed = _shorter_for_energy(_energy_excess(coarse, method, asked), method, asked.order)
    return float(np.clip(needed, NEAREST if np.isfinite(asked.energy_error) else 2.0, FARTHEST))


def _energy_excess(run, method, asked):
    """Energy error over what is asked, or over what rounding leaves where that is more."""
    return run.energy_error / max(asked.energy_error, _rounding_of_energy(run, method))


def _shorter_for_energy(excess, method, order):
    """How many times shorter a step that is likely to close the ledger has to be."""
    return (MARGIN * excess) ** (1.0 / min(method.order, 4.0 if order >= FIRST else 3.0))


class _Comparison(NamedTuple):
    """A march beside a coarser one."""

    dt: float
    difference: float
    energy_error: float
    wide: float  # [s] step of the coarser one
    estimate: float
    velocity: float  # error over what is asked for
    excess: float  # of the larger of velocity and energy
    shorter: float  # times, is a step that is likely to do
    amplified: bool  # whether the difference is what the motion makes of rounding


def _compared(coarse, fine, tried, method, asked):
    difference = _difference(coarse, fine, asked)
    before = next((one for one in reversed(tried) if one.wide > coarse.dt), None)
    order = _observed_order(before, difference, coarse.dt, asked.order)
    if before is None and coarse.dt > FAR_ENOUGH * fine.dt:
        order = FAR_FIRST.get(asked.order, order)
    shown = difference
    if asked.order <= JUMPS:  # where forces jump, two marches are alike by chance more often
        first = ALONE * difference
        shown = max(shown, before.difference * coarse.dt / before.wide if before else first)
    estimate = shown / ((coarse.dt / fine.dt) ** order - 1.0)
    scatter = SCATTER * EPSILON * np.sqrt(fine.n_steps * method.evaluations)
    stays = 0.5 * coarse.energy_error < fine.energy_error <= scatter
    amplified = method.kind != "implicit" and stays and scatter < difference / AMPLIFIED
    if amplified:
        # the motion makes of rounding what no step lessens: two marches are alike by chance
        estimate = BY_CHANCE * max([difference, *(one.difference for one in tried[-1:])])
    velocity, energy = estimate / asked.error, _energy_excess(fine, method, asked)
    if max(velocity, energy) <= 1.0 and asked.witness is not None:
        velocity = max(velocity, asked.witness(fine) / SHARED)
    return _Comparison(
        fine.dt, difference, fine.energy_error, coarse.dt, estimate, velocity,
        max(velocity, energy), _shortening(velocity, energy, method, asked.order), amplified,
    )  # fmt: skip


def _rounding_of_energy(run, method):
    """Energy error that no step avoids: of sums much larger than the motion, and of each part of
    each step."""
    largest = max(np.abs(part).max() for part in run.ledger)
    return EPSILON * (ULPS * largest / run.energy_scale + run.n_steps * method.evaluations)


def _require_hope(step, spent, tried, method, asked):
    """Raise UnstableStep where the next march is too long, or no longer one gets there."""
    rounding = EPSILON * asked.duration / step * method.evaluations
    if rounding > LOST * asked.error:
        raise UnstableStep(_rounded(asked.error, step, rounding))
    quick = len(tried) < 2 or (spent <= QUICK * asked.evaluations and not tried[-1].amplified)
    if spent > asked.evaluations or not (quick or _nears(tried, method, asked)):
        raise UnstableStep(_unreached(asked.error, step, tried))


def _nears(tried, method, asked):
    """Whether the excess, falling on as it did last, is gone within the evaluations allowed."""
    before, now = tried[-2:]
    order = np.log(before.excess / now.excess) / np.log(before.dt / now.dt)
    possible = asked.evaluations / (asked.duration / now.dt * method.evaluations)
    return bool(order > SLOWEST and now.excess ** (1.0 / order) <= possible)


def _observed_order(before, difference, wide, most):
    """Order by which the differences of marches fall, as far as it is believed: the first alone
    may be small by chance, or because both steps are too long to show an order."""
    if before is None:
        return min(FIRST, most)
    found = np.log(before.difference / difference) if difference > 0.0 else np.inf
    return float(np.clip(found / np.log(before.wide / wide) - BELOW, min(FIRST, most), most))


def _difference(coarse, fine, asked):
    """Largest velocity difference at the times that both have saved, over the scale."""
    every = asked.n_save // (coarse.t.size - 1)
    off = np.abs(fine.v[::every] - coarse.v)[:, asked.observed]
    return float(off.max()) / asked.scale


def _shortening(velocity, energy, method, order):
    """How many times shorter a step that is likely to do has to be, where the estimate and the
    energy are off by as many times what is asked."""
    likely = max(order, 0.75 * min(method.order, 4)) if order >= FIRST else 1.25
    shorter = (1.6 * velocity) ** (1.0 / likely) if velocity > 1.0 else 1.15
    return min(max(shorter, _shorter_for_energy(energy, method, order)), 8.0)


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
    scale = float(np.abs(v0).max()) or 1.0
    difference = float(np.abs(finer.v - trajectory.v).max()) / scale
    order = _assumed_order(chain, wall, SCHEMES[trajectory.scheme])
    return trajectory._replace(error_estimate=difference / (1.0 - 0.5**order))


def _assumed_order(chain, wall, method):
    if chain.dissipation.startswith("linear"):
        return JUMPS
    if chain.yield_overlap is not None:
        return YIELDS
    creeps = wall is not None and wall.mobility > 0.0
    return FIRST if creeps else min(MOST, method.order - 0.25)


def _unaffordable(error, duration, step, needed, allowed):
    return (
        f"error {error:g} over {duration:g} s is not reached within {allowed:.2g} evaluations, it "
        f"takes more than {needed:.2g} at dt = {step:.3g} s; ask for a larger error or less time"
    )


def _unreached(error, step, tried):
    found = "no march that stays finite (a negative residual compliance may be too large)"
    if tried:
        found = f"{tried[-1].estimate:.3g} in velocity, {tried[-1].energy_error:.3g} in energy"
    return (
        f"error {error:g} is not reached with dt = {step:.3g} s, found {found}; "
        "ask for a larger error or allow more evaluations"
    )


def _rounded(error, step, rounding):
    return (
        f"error {error:g} is not reached, rounding alone leaves up to {rounding:.2g} with "
        f"dt = {step:.3g} s; ask for a larger error or less time"
    )


def _first_step(method, error, energy_error):
    """Step times contact frequency that reaches both errors on a chain of 17 spheres, with a
    margin of 3 (measured; a longer first step fools the estimate of chains of unlike spheres)."""
    if method.kind == "implicit":
        return 0.1 * (error / 5e-2) ** 0.5 if method.order == 2 else 0.2 * (error / 6e-5) ** 0.25
    interval = stability_interval(method) * BOLDER.get(method.name, 1.0)
    if method.order == 2:
        return min(0.058 * min((error / 8e-3) ** 0.5, (energy_error / 5e-4) ** 0.5), 0.2 * interval)
    share = min((error / 3e-5) ** 0.25, (energy_error / 3e-6) ** 0.25)
    return interval * min(0.055 * share, 0.16)


def _sparser(n_save, limit):
    """Largest divisor of n_save that is not above the limit, n_save if there is none."""
    divisors = (n_save // k for k in range(1, 51) if n_save % k == 0)
    return next((m for m in divisors if m <= limit * (1 + 1e-9)), n_save)
