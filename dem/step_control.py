"""The step from the error asked for: pairs of marches by steps H > h, and what they differ by.

A step in which the force of a contact sets in as t^a misses an impulse of order h^(a + 1). These
contacts govern the error of a chain, whatever order its scheme has on smooth forces:

    p = 5/2   Hertz' law, dampers in proportion to its force          a = 3/2
    p = 2     stiffness that jumps: yield, the creep of a dashpot     a = 1
    p = 1     force that jumps: the linear dampers                    a = 0

(what the schemes mend of it: `event_order`).
An error C h^p makes two marches differ by C (H^p - h^p). The constant scatters from step to step,
with the phase of the contacts in their steps, so the larger one of the last two pairs counts, times
one safety factor:

    e = safety h^p max |v_h - v_H| / (H^p - h^p)

(L. F. Richardson; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I,
2nd ed., sec. II.4). What two marches cannot show is treated apart, see `march_to_error`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.between import run_between
from dem.chain import Chain, State, validate
from dem.checks import columns, positive, saves
from dem.kernels.arguments import Array
from dem.prepared import PreparedChain, prepare
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

    Shares of stated errors below the true ones are of 360 random scenes, six errors asked of each,
    by marches of 18 steps and a reference; costs are what `examples/cost_of_error.py` prints.
    """

    scheme: str | None = None  # None: what suits the chain
    energy_error: float | None = None  # to which the ledger closes; None: error / 100
    max_evaluations: float | None = None  # of all contacts; None: what takes about a minute

    # stated error over what the largest constant says. Of 240 scenes 4 are below; with 2, and with
    # orders lower by 1/2 of damped and by 1/4 of implicit marches, 2 are, but stated errors are
    # thirteen times the true ones in the median
    safety: float = 1.8
    # H/h of a first pair. 2: the coarse march costs half of the fine one and twice as many smooth
    # scenes are below; 5: marches of the coarse step show less, forces that jump cost a tenth more
    ratio: float = 4.0
    # first H times the fastest contact's rate, over the stability interval and error^(1/order).
    # 1.5: a tenth dearer; 1.9 to 2.1 alike; 2.5: first pairs are often repeated
    boldness: float = 2.0
    # the next step aims so much below the errors, which scatter; costs are within a tenth
    velocity_margin: float = 1.5  # from 1 to 2
    energy_margin: float = 2.0  # from 1.6 to 3
    # instants at least at which velocities are compared. Where they are few, two marches are alike
    # by chance: three of the four smooth scenes that were below had one or ten
    instants: int = 100
    # difference, over the speed, up to which it grows with the error: velocities are bounded. With
    # no limit a beam struck again and again stated 4e-3 where 0.1 was true
    bounded: float = 0.05
    # times sqrt(evaluations) eps: what rounding leaves in a ledger by a random walk; not varied
    rounding_walk: float = 3.0
    # times the error: rounding that would be left if all added up, which it rarely does; not varied
    rounding_excess: float = 30.0
    # of the energy: work of dampers by which two schemes may differ; not varied
    damper_energy: float = 0.05


USUAL_SEARCH = StepSearch()


class MarchPair(NamedTuple):
    """A march compared with a coarser one."""

    dt: float  # [s]
    difference: float  # largest of the velocities, over the scale
    energy_error: float
    estimate: float  # of the velocity error of the finer march
    alone: float  # what the pair says of it by itself
    excess: float  # the larger of velocity and energy error, each over what is asked for


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
    the observed spheres (indices, None for all), and whose energy is by less than a hundredth.

    A coarse march comes first; its ledger sets the step of the next, which is compared with it.
    Where the pair does not do, finer marches follow. Beyond the estimate above:

    - Forces that jump: constants scatter down to nothing, and the first pair never suffices.
      (With p = 5/4 and a factor of 2: one pair 4 % of such scenes below, two 0.7 %.)
    - Differences above `bounded` count in full, without an order: velocities are bounded. The
      motion is sensitive, and constants scatter more: p is lower by one from there on.
    - Differences of two marches whose ledgers close to rounding count in full as well, the larger
      one of two: motion that amplifies rounding (beads that rattle between others a hundred times
      as large) differs by as much at any step. Implicit schemes close the ledger at any step, and
      where forces jump it may close while velocities converge: there this says nothing.
    - Implicit steps longer than the dampers' time: all may be wrong alike, as their ledger closes
      at any step. The work of the dampers is compared with that of "verlet", which moves them one
      by one, each exactly.

    Raises UnstableStep where no march is finite, where the evaluations allowed or rounding forbid
    the error, where energies underflow, where such two differ by more than it, and where a step 64
    times as short has not halved it.
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
    implicit, evaluations = method.kind == "implicit", method.evaluations
    state = start(prepared, v0)
    observed = columns(observed, chain.mass.size)
    speed = float(np.abs(v0).max()) or 1.0
    order = event_order(prepared, method)
    jumps = order < 2.0
    energy_order = min(method.order, 4.0 if order > 2.0 else 3.0)  # by which ledgers close
    energy_error = search.energy_error or max(1e-2 * error, 1e-12)
    allowed = search.max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)
    allowed = allowed / 20 if implicit else allowed  # Newton iterations
    thinned = -(-search.instants // n_save)  # instants compared over those saved
    n_compared = n_save * thinned
    pairs: list[MarchPair] = []
    spent, sensitive = 0.0, False
    target = f"error {error:g} over {duration:g} s"

    def attempt(step, n_save):
        """The march by steps up to `step`, None where it is unstable; raises UnstableStep where it
        would cost too much or be lost in rounding."""
        nonlocal spent
        ahead = duration / step * evaluations
        if not spent + ahead <= allowed:
            so_far = ""
            if pairs:
                velocity, energy = pairs[-1].estimate, pairs[-1].energy_error
                so_far = f", dt = {pairs[-1].dt:.3g} s leaves {velocity:.3g} in velocity, "
                so_far += f"{energy:.3g} in energy"
            elif coarse is None and spent > 0.0:
                so_far = (
                    ", no march stayed finite (a negative residual compliance may be too large)"
                )
            raise UnstableStep(
                f"{target} is not reached within {allowed:.2g} evaluations{so_far}; the next "
                f"march, with dt = {step:.3g} s, takes {ahead:.2g}: ask for a larger error, for "
                "less time, or allow more evaluations"
            )
        if EPSILON * ahead > search.rounding_excess * error:
            raise UnstableStep(lost_in_rounding(error, EPSILON * ahead, step))
        try:
            march = run_between(prepared, state, duration, step, method, n_save)
        except UnstableStep:
            spent += ahead
            return None
        spent += march.n_steps * evaluations
        return march

    def shared_saves(step):
        """A step near `step`, and the number of saves that its march shares with the last one: the
        largest divisor of n_compared that is no more than its steps. They end at these saves,
        which is quicker than to sample between few of them."""
        n = duration / step
        divisors = (n_compared // k for k in range(1, 51) if n_compared % k == 0)
        m = next((m for m in divisors if m <= n * (1 + 1e-9)), None)
        stride = 1 if m is None else math.ceil(n / m * (1 - 1e-9)) if jumps else round(n / m)
        return (step, n_compared) if m is None else (duration / (m * stride), m)

    # coarse march. Light wall modes make contacts stiff for stability, not for the accuracy of
    # their solution: the rate is that of the contacts before a rigid wall
    if wall is not None and wall.omega.size:
        rate = max(fastest_rate(prepared._replace(wall=None), v0), 1.0 / duration)
    interval = float(evaluations) if implicit else stability_interval(method)
    phase = interval * min(search.boldness * error ** (1.0 / min(method.order, 4)), 0.6)
    step, coarse = min(phase / rate, duration), None
    while (coarse := attempt(*shared_saves(step))) is None:
        step /= search.ratio

    # its ledger sets the next step
    shorter = search.ratio
    if not implicit:
        excess = search.energy_margin * coarse.energy_error / energy_error
        shorter = excess ** (1.0 / energy_order)
        shorter = min(max(shorter, 1.4), 1.5 * search.ratio)  # a pair of like steps says nothing
    step = coarse.dt / shorter

    while True:
        last = bool(pairs) or not jumps  # whether the pair may do
        fine = attempt(*((step, n_compared) if last else shared_saves(step)))
        if fine is None:
            step /= search.ratio
            continue

        if 0.0 < fine.energy_scale < np.finfo(float).tiny / EPSILON:
            raise UnstableStep(
                f"{target} is not reached: energies of {fine.energy_scale:.1g} J underflow; take "
                "larger masses, stiffnesses or speeds"
            )

        # velocity error of the fine march
        h, H = fine.dt, coarse.dt
        difference = _velocity_difference(coarse, fine, observed, speed)
        walk = search.rounding_walk * EPSILON * (fine.n_steps * evaluations) ** 0.5
        closed = max(coarse.energy_error, fine.energy_error) <= walk
        rounded = not implicit and not jumps and closed
        no_order = rounded or difference > search.bounded
        if difference > search.bounded and not sensitive:
            sensitive, order = True, max(order - 1.0, 1.0)
        alone = search.safety * difference / (1.0 if no_order else (H / h) ** order - 1.0)
        estimate = alone
        if pairs:
            fall = 1.0 if no_order else (h / pairs[-1].dt) ** order
            estimate = max(alone, pairs[-1].alone * fall)
        velocity = estimate / error

        # energy error, over the one asked for or over what rounding leaves if that is more: of sums
        # much larger than the motion, and of every part of every step
        energy = fine.energy_error / energy_error
        if energy > 1.0:
            largest = max(np.abs(entry).max() for entry in fine.ledger) / fine.energy_scale
            rounding = EPSILON * (4.0 * largest + fine.n_steps * evaluations)
            energy = min(energy, fine.energy_error / rounding)

        # implicit steps that do not resolve the dampers
        unresolved = implicit and prepared.damping is not None
        if unresolved and max(velocity, energy) <= 1.0 <= h * fastest_decay(prepared, state.v):
            try:
                verlet = run(prepared, state, fine.t[-1], h, SCHEMES["verlet"], 1)
                work = abs(verlet.dissipated_contact[-1] - fine.dissipated_contact[-1])
            except UnstableStep:
                work = np.inf
            velocity = max(velocity, work / fine.energy_scale / search.damper_energy)

        excess = max(velocity, energy)
        pairs.append(MarchPair(h, difference, fine.energy_error, estimate, alone, excess))
        if last and excess <= 1.0:
            break
        # give up where much shorter steps were no better
        longer = [pair for pair in pairs if pair.dt >= 64.0 * h and excess > 0.5 * pair.excess]
        if rounded:
            longer = pairs[-2:-1]
        if longer:
            raise UnstableStep(
                f"{target} is not reached: dt = {h:.3g} s leaves {estimate:.3g} in velocity, "
                f"{fine.energy_error:.3g} in energy, dt = {longer[-1].dt:.3g} s "
                f"{longer[-1].estimate:.3g}, as of motion that amplifies rounding; ask for a "
                "larger error or for less time"
            )

        # the next step, likely to do; beside the same coarse march where little is missing
        shorter = 2.0 if jumps else 1.15
        if velocity > 1.0 and no_order:
            shorter = search.ratio
        elif velocity > 1.0:
            shorter = max(shorter, (search.velocity_margin * alone / error) ** (1.0 / order))
        if energy > 1.0:
            shorter = max(shorter, (search.energy_margin * energy) ** (1.0 / energy_order))
        step = h / min(shorter, search.ratio**2)
        if jumps or H > 2.0 * search.ratio * step:
            coarse = fine

    report = StepReport(
        np.array([pair.dt for pair in pairs]),
        np.array([pair.difference for pair in pairs]),
        np.array([pair.energy_error for pair in pairs]),
        estimate,
        int(spent),
    )
    if thinned > 1:
        saved = {name: a for name, a in fine._asdict().items() if isinstance(a, np.ndarray)}
        fine = fine._replace(**{name: a[::thinned] for name, a in saved.items()})
    return Controlled(fine._replace(error_estimate=estimate), report)


def event_order(prepared: PreparedChain, method: Scheme) -> float:
    """Order p of what a step misses of a contact that opens, closes or yields in it.

    The explicit schemes correct Hertz contacts after the step, which leaves order 7/2 of the march
    and 5/2 of samples between its steps: 3 is taken. The implicit ones average a force that jumps,
    which leaves 3/2.
    """
    chain, wall = prepared.chain, prepared.wall
    order = 3.0
    if chain.yield_overlap is not None or (wall is not None and wall.mobility > 0.0):
        order = 2.0
    if prepared.damping is not None and chain.dissipation.startswith("linear"):
        order = 1.5 if method.kind == "implicit" else 1.0
    return min(order, method.order)


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
    order = event_order(prepare(chain, wall), SCHEMES[trajectory.scheme])
    estimate = USUAL_SEARCH.safety * difference / (1.0 - 0.5**order)
    return trajectory._replace(error_estimate=estimate)


def lost_in_rounding(error: float, rounding: float, dt: float) -> str:
    """Sentence on an error that no step [s] reaches, because rounding alone leaves more."""
    return (
        f"error {error:g} is not reached, rounding alone leaves up to {rounding:.2g} with "
        f"dt = {dt:.3g} s; ask for a larger error or less time"
    )


def _velocity_difference(coarse, fine, observed, speed):
    """Largest difference of the observed velocities at the instants that both marches have saved,
    over the speed."""
    instants = math.gcd(fine.t.size - 1, coarse.t.size - 1)
    fine_v, coarse_v = (run.v[:: (run.t.size - 1) // instants] for run in (fine, coarse))
    return float(np.abs((fine_v - coarse_v)[:, observed]).max()) / speed
