"""The step from the error asked for: marches by steps H > h, and what they differ by.

An error C h^p makes two marches differ by C (H^p - h^p), so that of the march by h is

    e = safety h^p max |v_h - v_H| / (H^p - h^p)

over the coarser marches by H (L. F. Richardson; E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I, 2nd ed., sec. II.4). A step in which the force of a contact sets
in as t^a misses an impulse of order h^(a + 1), and these contacts govern the error of a chain,
whatever order its scheme has on smooth forces:

    p = 5/2   Hertz' law, a = 3/2; it also governs contacts that yield, most of it at the peak of
              the overlap, where a = 2 alone would give 3
    p = 3/2   force that jumps and is averaged over the step (implicit schemes); dampers in
              proportion to the contact's force, where they exceed it
    p = 1     force that jumps, a = 0

p = 3 for Hertz' law and 2 for yield, with pairs of steps in the ratio of 4 to 6, stated too little
for the first and too much for the second. Of 698 random scenes 13 then stated less than their true
error; with the orders above 5 do.

Where forces jump or contacts yield, C depends on the phase of the event in its step and scatters
down to nothing: one pair may be alike by chance (steps of 2 h and h share their ends, and both
missed 1.35e-6 where they differed by 1.6e-7). There C is the largest of three coarser marches of
different phases, which cost less than a finer one: with two of them 9 of 434 such scenes state less
than their true error, with three 3. What marches cannot show is treated apart, see
`march_to_error`. Of 2000 other scenes (`python benchmarks/step_errors.py 2000 57`) 0.4 % state less
than their true error: 0.1 % of those with smooth forces, 1.1 % of those whose contacts yield.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.between import run_between
from beadwave.dem.chain import Chain, State, validate
from beadwave.dem.checks import columns, positive, saves
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.prepared import PreparedChain, prepare
from beadwave.dem.richardson import richardson
from beadwave.dem.schemes import SCHEMES, Scheme
from beadwave.dem.stability import (
    UnstableStep,
    fastest_decay,
    fastest_rate,
    marching_scheme,
    stability_interval,
)
from beadwave.dem.trajectory import ArrayErrors, Trajectory, march, run, start
from beadwave.dem.walls import Wall

EPSILON = float(np.finfo(float).eps)


class StepReport(NamedTuple):
    """Record of the search for a step: one entry per comparison of two marches, coarse to fine."""

    dt: Array  # (n_pairs,) [s] of the finer march
    difference: Array  # (n_pairs,) relative velocity change against the coarser march
    energy_error: Array  # (n_pairs,) of the finer march, over the energy at the start
    error_estimate: float  # of the last one's velocities, over the largest initial speed
    evaluations: int  # contact force evaluations of all marches


class ControlledMarch(NamedTuple):
    """A march and the report on its step."""

    trajectory: Trajectory
    step_report: StepReport


class StepSearch(NamedTuple):
    """Search for the step of a march to an error: three choices, then tuned numbers.

    Scenes are those of `benchmarks/step_errors.py`; "below" are those that state less than their
    true error. Costs are what `benchmarks/cost_of_error.py` prints.
    """

    scheme: str | None = None  # None: what suits the chain
    energy_error: float | None = None  # to which the ledger closes; None: error / 100
    max_evaluations: float | None = None  # of all contacts; None: what takes about a minute

    # stated error over what the largest constant says. Of 698 scenes 5 are below with 1.5. With 1.8
    # at orders 3 (Hertz) and 2 (yield) 10 were, and medians of stated over true errors above ten
    safety: float = 1.5
    # stated errors of every sphere and contact over the same: each of many columns may be alike in
    # two marches by chance. Of 150 runs that observe their first sphere alone, the error of one
    # column or more was below with 1 in 4, with 2 in 2
    columns: float = 2.0
    # the same where contacts yield. Of 394 such scenes 9 are below with 1.5, 3 with 2, at the same
    # cost over that of the last march
    safety_yielding: float = 2.0
    # coarser marches, by steps up to ratio^2 h, that are compared where constants scatter. 2: twice
    # as many such scenes are below; 4: a quarter dearer
    constants: int = 3
    # H/h of a first pair; further coarse marches take steps from 2 ratio h down by a fifth each.
    # 2: first pairs cost more; 2.5 and 3 leave as many smooth scenes below
    ratio: float = 4.0
    # H/h from which on a march is compared: those of like steps have like errors; not varied
    like: float = 1.4
    # first H times the fastest contact's rate, over the stability interval and error^(1/order).
    # 1.5: a tenth dearer; 1.9 to 2.1 alike; 2.5: first pairs are often repeated
    boldness: float = 2.0
    # the next step aims so much below the energy error; from 1.6 to 3 costs are within a tenth.
    # The velocity error needs none, its safety is enough: with 1.4 or 2 costs are the same or more
    margin: float = 2.0
    # instants at least at which velocities are compared. Where they are few, two marches are alike
    # by chance: three of the four smooth scenes that were below had one or ten
    instants: int = 100
    # difference, over the speed, up to which it grows with the error: velocities are bounded. With
    # no limit a beam struck again and again stated 4e-3 where 0.1 was true
    bounded: float = 0.05
    # of the error asked: no less is stated. Marches that differ by less are often alike by chance:
    # of 1070 smooth scenes 1.5 % were below, of 414 that yield 2.7 %; with 1/50 0.9 and 1.0, with
    # 1/30 0.6 and 0.5, with 1/10 0.2 and 0.5
    least: float = 1.0 / 30.0
    # times sqrt(evaluations) eps: what rounding leaves in a ledger by a random walk; not varied
    rounding_walk: float = 3.0
    # times the error: rounding that would be left if all added up, which it rarely does; not varied
    rounding_excess: float = 30.0
    # marches that are not finite, after which a search before a wall of negative residual
    # compliance ends: beyond its fold no step is short enough; not varied
    most_unstable: int = 4
    # of the energy: work of dampers by which two schemes may differ; not varied
    damper_energy: float = 0.05

    def factor(self, chain: Chain) -> float:
        """Stated error over what the largest constant says, by the chain's contacts."""
        return self.safety if chain.yield_overlap is None else self.safety_yielding


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
) -> ControlledMarch:
    """Trajectory from velocities v0 (n,) [m/s] at n_save + 1 equal times to `duration` [s], whose
    velocities on the observed spheres (indices, None for all) are off by less than `error` times
    the largest initial speed, and whose energy ledger closes to `search.energy_error`, usually
    error / 100. The velocity error stated is at least `search.least` times `error`. `errors` of the
    trajectory has the error of every sphere and contact, of those that are not observed too.

    A coarse march comes first; its ledger sets the step of the next, which is compared with it.
    Where the pair does not do, finer marches follow. Beyond the estimate above:

    - Forces that jump: the first pair never suffices, it is too coarse to tell.
    - Differences above `bounded` count in full, without an order: velocities are bounded. The
      motion is sensitive, and constants scatter more: p is lower by one from there on.
    - Differences of two marches whose ledgers close to rounding count in full as well, the larger
      one of two: motion that amplifies rounding (beads that rattle between others a hundred times
      as large) differs by as much at any step. Implicit schemes close the ledger at any step, and
      where forces jump it may close while velocities converge: there this says nothing.
    - Implicit steps longer than the dampers' time: all may be wrong alike, as their ledger closes
      at any step. The work of the dampers is compared with that of "verlet", which moves them one
      by one, each exactly.

    Raises InvalidChain, NoEquilibrium; UnstableStep where no march is finite, where the evaluations
    allowed or rounding forbid the error, where energies underflow, where two marches with closed
    ledgers differ by more than the error, and where a step 64 times as short has not halved it.
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
    order = event_order(prepared, method, speed)
    jumps = prepared.damping is not None and chain.jumps
    scatters = jumps or chain.slides or chain.yield_overlap is not None
    safety = search.factor(chain)
    energy_order = min(method.order, 3.0 if scatters else 4.0)  # by which ledgers close
    energy_error = search.energy_error or max(1e-2 * error, 1e-12)
    allowed = search.max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)
    allowed = allowed / 20 if implicit else allowed  # Newton iterations
    thinned = -(-search.instants // n_save)  # instants compared over those saved
    n_compared = n_save * thinned
    pairs: list[MarchPair] = []
    spent, unstable, sensitive = 0.0, 0, False
    target = f"error {error:g} over {duration:g} s"

    def attempt(step, n_save):
        """The march by steps up to `step`, None where it is unstable; raises UnstableStep where it
        would cost too much or be lost in rounding."""
        nonlocal spent, unstable

        # before the march: what it takes, and what rounding would leave if all of it added up
        ahead = duration / step * evaluations
        if not spent + ahead <= allowed:
            so_far = ""
            if pairs:
                velocity, energy = pairs[-1].estimate, pairs[-1].energy_error
                so_far = f", dt = {pairs[-1].dt:.3g} s leaves {velocity:.3g} in velocity, "
                so_far += f"{energy:.3g} in energy"
            elif unstable:
                so_far = f", {unstable} marches did not stay finite"
                if wall is not None and wall.residual_compliance < 0.0:
                    so_far += " (the wall's negative residual compliance may be too large)"
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
            unstable += 1
            soft = 0.0 if wall is None else wall.residual_compliance
            if unstable >= search.most_unstable and soft < 0.0:
                raise UnstableStep(
                    f"{target} is not reached: {unstable} marches did not stay finite, the last by "
                    f"dt = {step:.3g} s; before the wall's negative residual compliance of "
                    f"{soft:.3g} m/N the last contact may find no force: take one "
                    "nearer to 0, or lower speeds"
                ) from None
            return None
        spent += march.n_steps * evaluations
        return march

    def shared_saves(step):
        """A step near `step` that lands on saves, and on how many of the n_compared saves it lands:
        a quotient of n_compared by 1 to 50 that is no more than its steps. To end at saves is
        quicker than to sample between few of them."""
        n = duration / step
        divisors = (n_compared // k for k in range(1, 51) if n_compared % k == 0)
        m = next((m for m in divisors if m <= n * (1 + 1e-9)), None)
        stride = 1 if m is None else math.ceil(n / m * (1 - 1e-9)) if jumps else round(n / m)
        return (step, n_compared) if m is None else (duration / (m * stride), m)

    # the coarse march. Light wall modes make contacts stiff for stability, not for the accuracy of
    # their solution: the rate is that of the contacts before a rigid wall
    if wall is not None and wall.omega.size:
        rate = max(fastest_rate(prepared._replace(wall=None), v0), 1.0 / duration)
    interval = float(evaluations) if implicit else stability_interval(method)
    phase = interval * min(search.boldness * error ** (1.0 / min(method.order, 4)), 0.6)
    step = min(phase / rate, duration)
    while (coarse := attempt(*shared_saves(step))) is None:
        step /= search.ratio

    # its ledger sets the next step
    shorter = search.ratio
    if not implicit:
        excess = search.margin * coarse.energy_error / energy_error
        shorter = excess ** (1.0 / energy_order)
        shorter = min(max(shorter, search.like), 1.5 * search.ratio)
    step, coarser = coarse.dt / shorter, [coarse]

    while True:
        last = bool(pairs) or not jumps  # whether the march may do
        fine = attempt(*((step, n_compared) if last else shared_saves(step)))
        if fine is None:
            step /= search.ratio
            continue

        if 0.0 < fine.energy_scale < np.finfo(float).tiny / EPSILON:
            raise UnstableStep(
                f"{target} is not reached: energies of {fine.energy_scale:.1g} J underflow; take "
                "larger masses, stiffnesses or speeds"
            )

        # energy error, over the one asked for or over what rounding leaves if that is more: of sums
        # much larger than the motion, and of every part of every step
        energy = fine.energy_error / energy_error
        if energy > 1.0:
            largest = max(np.abs(entry).max() for entry in fine.ledger) / fine.energy_scale
            # its entries are sums over n contacts, whose rounding walks by sqrt(n): 800 spheres in
            # a column under their weight left 1.5 times what 4 alone allows
            sums = 4.0 + math.sqrt(chain.mass.size)
            rounding = EPSILON * (sums * largest + fine.n_steps * evaluations)
            energy = min(energy, fine.energy_error / rounding)

        # difference from the nearest coarser march: whether the error has an order
        h = fine.dt
        unlike = [march for march in coarser if march.dt >= search.like * h * (1.0 - 1e-9)]
        nearest = min(unlike, key=lambda march: march.dt)
        difference = _velocity_difference(nearest, fine, observed, speed)
        walk = search.rounding_walk * EPSILON * (fine.n_steps * evaluations) ** 0.5
        closed = max(nearest.energy_error, fine.energy_error) <= walk
        rounded = not implicit and not jumps and closed
        no_order = rounded or difference > search.bounded
        if difference > search.bounded and not sensitive:
            sensitive, order = True, max(order - 1.0, 1.0)

        # velocity error, from a constant for each coarser march. Where constants scatter and the
        # error would do, further coarse marches sample them, by steps of other phases
        constants = []
        wanted = search.constants if scatters and last and not no_order else 1
        H = 2.0 * search.ratio * h
        while True:
            for coarse in unlike[len(constants) :]:
                d = _velocity_difference(coarse, fine, observed, speed)
                constants.append(richardson(d, coarse.dt / h, order))
            alone = safety * (difference if no_order else max(constants))
            near = sum(march.dt <= search.ratio**2 * h for march in unlike)
            if near >= wanted or max(alone / error, energy) > 1.0:
                break
            if H < search.like * h:
                # the saves leave no room for other steps: the difference counts in full, of a
                # second pair (of a single one 0.18 of an error was stated)
                alone, last = max(alone, safety * difference), bool(pairs)
                break
            dt, n_shared = shared_saves(H)
            dt, H = min(dt, duration / n_shared), 0.8 * H
            if all(abs(march.dt / dt - 1.0) > 0.1 for march in [fine, *unlike]):
                coarse = attempt(dt, n_shared)
                if coarse is not None and coarse.dt >= search.like * h:
                    unlike.append(coarse)
        estimate = max(alone, pairs[-1].alone) if no_order and pairs else alone
        velocity = estimate / error

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
        # rounding keeps open a ledger whose sums are much larger than the motion: where no other
        # energy error is asked for, one below that of the velocities will do
        if (
            longer
            and velocity <= 1.0
            and search.energy_error is None
            and (fine.energy_error <= error)
        ):
            break
        if longer:
            before = longer[-1]
            raise UnstableStep(
                f"{target} is not reached: dt = {h:.3g} s leaves {estimate:.3g} in velocity (at "
                f"most {error:.3g}) and {fine.energy_error:.3g} in energy (at most "
                f"{energy_error if search.energy_error else error:.3g}), dt = {before.dt:.3g} s "
                f"{before.estimate:.3g} and {before.energy_error:.3g}, as of motion that amplifies "
                "rounding; ask for a larger error or for less time"
            )

        # the next step, likely to do
        shorter = 2.0 if jumps else 1.15
        if velocity > 1.0 and no_order:
            shorter = search.ratio
        elif velocity > 1.0:
            shorter = max(shorter, (alone / error) ** (1.0 / order))
        if energy > 1.0:
            shorter = max(shorter, (search.margin * energy) ** (1.0 / energy_order))
        step = h / min(shorter, search.ratio**2)
        # a march that is off by more than `bounded` shows no constant
        coarser = [fine] if difference > search.bounded else [*unlike, fine]

    estimate = max(estimate, search.least * error)

    def column_errors(name, scale):
        """Error of every column of an array of the trajectory, of size `scale`, by the marches
        compared last."""
        # a force that jumps is off by the jump at instants between its events in two marches
        jumping = jumps and name == "contact_force"
        worst = np.zeros(getattr(fine, name).shape[1])
        for coarse in unlike:
            d = _differences(coarse, fine, name)
            in_full = no_order or near < wanted or jumping or d > search.bounded * scale
            worst = np.maximum(worst, np.where(in_full, d, richardson(d, coarse.dt / h, order)))
        return np.maximum(safety * search.columns * worst, search.least * error * scale)

    errors = ArrayErrors(
        column_errors("x", float(np.abs(fine.x - fine.x[0]).max())),
        column_errors("v", speed),
        column_errors("contact_force", float(np.abs(fine.contact_force).max(initial=0.0))),
    )
    # what the estimate adds, by a pair before or for dampers, holds for all columns
    share = max(1.0, estimate * speed / float(errors.v[observed].max()))
    errors = ArrayErrors(*(share * values for values in errors))

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
    return ControlledMarch(fine._replace(error_estimate=estimate, errors=errors), report)


def event_order(prepared: PreparedChain, method: Scheme, speed: float) -> float:
    """Order p of what a step misses of a contact that opens, closes or yields in it.

    The explicit schemes correct Hertz contacts after the step, which leaves order 7/2 of the march
    and 5/2 of samples between its steps; of a force that sets in as t^a without correction order
    a + 1 is left. Dampers in proportion to the contact's force exceed it
    where gamma times the largest speed [m/s] is above 1; they decay faster than the contact opens,
    and orders of 1.4 to 2 were measured.
    """
    chain = prepared.chain
    order = 2.5 if chain.elastic.shape is None else chain.elastic.opening + 1.0
    if prepared.damping is not None:
        if chain.jumps:
            order = 1.5 if method.kind == "implicit" else 1.0
        elif prepared.damping.gamma.max() * speed > 1.0:
            order = 1.5
    return min(order, method.order)


def with_step_error(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    trajectory: Trajectory,
    *,
    state: State | None = None,
) -> Trajectory:
    """The trajectory of a given step from velocities v0 (n,) [m/s], its relative velocity error
    estimated by a march at half the step:  e = safety |v_h - v_h/2| / (1 - 2^-p).

    The estimate is cautious like that of `march_to_error`, on all spheres; `state` is what the
    trajectory continued, if it did. One pair may be alike by chance where forces jump or contacts
    yield: there it says less than `march_to_error`. Raises what `march` does.
    """
    finer = march(
        chain, wall, v0, duration=float(trajectory.t[-1]), dt=trajectory.dt / 2.0,
        scheme=trajectory.scheme, n_save=trajectory.t.size - 1, state=state,
    )  # fmt: skip
    speed = float(np.abs(v0).max()) or 1.0
    difference = _velocity_difference(trajectory, finer, np.arange(chain.mass.size), speed)
    order = event_order(prepare(chain, wall), SCHEMES[trajectory.scheme], speed)
    estimate = USUAL_SEARCH.factor(chain) * difference / (1.0 - 0.5**order)
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
    return float(_differences(coarse, fine, "v")[observed].max()) / speed


def _differences(coarse, fine, name):
    """Largest difference of each column of an array at the instants that both marches have
    saved."""
    instants = math.gcd(fine.t.size - 1, coarse.t.size - 1)
    a, b = (getattr(run, name)[:: (run.t.size - 1) // instants] for run in (fine, coarse))
    return np.abs(a - b).max(axis=0)
