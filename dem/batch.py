"""Many chains at once: equal in length and wall modes, different in everything else.

Chains lie side by side in the lanes of vector registers and in blocks on the threads: Hertz
contacts, dissipation, preload, weight, leaf springs, walls without or with modes and a residual
spring. Chains with yield, friction or a dashpot, and those of implicit schemes as the linear
dampers take, are marched one by one, dealt to the threads. Steps do not stop at the samples, which
lie on polynomials of the steps.

To an error, every chain has steps of its own, in proportion to the period of its fastest contact,
and an estimate of its own, from marches of that chain by steps h and H:

    e  ~  |v_h - v_H| / ((H/h)^p - 1)

with an order p that is assumed for a first pair (H/h = 4: the difference over 13), and lower for
marches that are refined.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from beadwave.dem.chains import Chains
from beadwave.dem.checks import InvalidChain, columns, positive, saves, whole
from beadwave.dem.dense import values_between, velocities_between
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.lanes import LaneSteps
from beadwave.dem.lanes import LaneRuns, march_side_by_side
from beadwave.dem.prepared import prepare
from beadwave.dem.richardson import richardson
from beadwave.dem.schemes import SCHEMES, named_scheme
from beadwave.dem.stability import UnstableStep, fastest_rate, marching_scheme, stability_interval
from beadwave.dem.step_control import EPSILON, StepSearch, lost_in_rounding, march_to_error
from beadwave.dem.trajectory import equal_steps, march


class Batch(NamedTuple):
    """Results of many marches: n_chains chains, k saves.

    To an error, every chain has steps of its own, and those that cannot be brought to it are NaN,
    with the reason in `refused`.
    """

    t: Array  # (k,) [s]
    v: Array  # (n_chains, k, n_observed) [m/s]
    wall_force: Array  # (n_chains, k) [N], 0 for free chains
    energy_error: Array  # (n_chains,) largest change over the energy at the start
    dt: float | Array  # [s] as given, or (n_chains,) found for the error
    n_steps: int | Array  # of all chains, or (n_chains,)
    scheme: str
    error_estimate: Array | None = None  # (n_chains,) relative velocity errors
    refused: Mapping[int, str] = MappingProxyType({})  # chains that miss the error, and why


# Search for the steps of a batch to an error.
#
# Where no range is given, none is on record; `examples/sweep_errors.py` prints what a change does
# to stated errors and costs on random rows.
# first steps
BOLDNESS = 0.055  # h over the stability interval at error 1e-4
MAX_STEP_SHARE = 0.15  # h over the stability interval at most
N_PILOTS = 16  # chains that correct the first steps before all are marched
PILOT_SHARE = 0.95  # of the pilots that are to keep pilot_error
PILOT_ERROR = 0.6  # estimate over the error asked for
PILOT_BOUNDS = (0.25, 3.0)  # times longer, by one round of pilots
SETTLED_BOUNDS = (0.6, 1.6)  # times longer: no further round of pilots
# velocity difference beyond which a pilot that keeps its energy counts as chaotic: then the
# difference says nothing about the step
CHAOTIC_DIFFERENCE = 1e-2

# steps H of the coarse march over those h of the fine one
FIRST_RATIO = 4.0  # of the first pair: the coarse march adds a quarter of the cost
MAX_RATIO = 8.0  # of a fine march repeated with shorter steps against the same coarse

# Order p by which the difference of a pair is taken to fall. Between steps velocities lie on
# polynomials, off by order 2.5 where a contact opens or closes in the step; the march itself
# keeps 3.5. Differences scatter: of 7000 random rows the error was above the difference over 8
# in two, above that over 13 in 20, never above 2.7 times that. 4^1.9 - 1 = 13, 4^1.16 - 1 = 4,
# as chains that have to be refined are sensitive.
FIRST_ORDER = 1.9
LATER_ORDER = 1.16  # at most, where differences of refined steps show an order
SLOWEST_ORDER = 0.5  # at least, there
ORDER_CAUTION = 0.5  # taken off the order that refined steps show, which scatters
FASTEST_ORDER = 4.0  # no scheme falls faster: a smaller difference is small by chance
STEP_ORDER = 3.0  # what coarse marches show, for the next step

# the next step
ERROR_MARGIN = 1.6  # in the error, of steps that are to reach it
ENERGY_SHARE = 0.1  # of the error, that steps may leave in the energy
ROUNDING_WALK = 3.0  # times sqrt(evaluations) eps, of rounding in a march
ROUNDING_EXCESS = 30.0  # times the error: left by rounding, where no step reaches it

# effort
MAX_GROUP = 64  # chains that march together at most ...
GROUP_SPREAD = 2.0  # ... if their numbers of steps are within this ratio
MAX_ROUNDS = 5  # of marches, before the search of a single run takes over
MAX_STEPS = 1e6  # of a chain in the lanes


class _BatchRequest(NamedTuple):
    """Request of a batch: duration, saves, scheme, threads of all its chains."""

    duration: float  # [s]
    n_save: int
    observed: Array
    scheme: str
    threads: int


def march_batch(
    chains: Chains,
    *,
    duration: float,
    dt: float | None = None,
    error: float | None = None,
    observed: Sequence[int] | None = None,
    scheme: str | None = None,
    n_save: int = 100,
    threads: int | None = None,
) -> Batch:
    """Chains that start from their static state, marched side by side for `duration` [s] and saved
    at n_save + 1 equal times at the observed spheres (indices, None for all).

    Give dt [s], or the velocity error relative to the largest initial speed of each chain: the step
    of each is then found, and its error estimated, by marches of that chain. Without `threads` as
    many as there are cores; results do not depend on their number. Raises InvalidChain,
    NoEquilibrium, UnstableStep (of a given dt).
    """
    if (dt is None) == (error is None):
        raise InvalidChain("give either dt or error to say how finely to march")

    # one scheme for all: what suits the most damped chain
    chain, wall, v0 = chains[chains.most_damped]
    if chains.damped:
        prepared = prepare(chain, wall)
        rate = max(fastest_rate(prepared, v0), 1.0 / duration)
        scheme = marching_scheme(prepared, v0, 1.0 / (3.0 * rate), scheme).name
    else:
        scheme = named_scheme(scheme, chain, wall).name

    observed = columns(observed, chains.mass.shape[1])
    saves(n_save, chains.mass.size)
    positive("duration", duration, " s")
    positive("dt" if error is None else "error", dt if error is None else error)
    if threads is not None:
        whole("threads", threads)
    request = _BatchRequest(duration, n_save, observed, scheme, threads or os.cpu_count() or 1)
    return _march_to_error(chains, error, request) if dt is None else _march(chains, dt, request)


def _march_to_error(chains, error, request):
    """Every chain to the error by steps of its own, judged by its own marches.

    Each chain is marched twice, by fine steps h and coarse steps H. Its error is estimated from the
    difference of the two by Richardson's extrapolation, e = |v_h - v_H| / ((H / h)^p - 1).

    The first steps are the same share of the period of each chain's fastest contact, found with the
    chains of a pilot. A chain that misses the error is marched by shorter steps, against the same
    coarse march where few more are needed, else against its last one. Chains that do not reach the
    error this way are left to `march_to_error`, except those in which rounding alone grows far
    beyond the error: no step mends that.
    """
    method = SCHEMES[request.scheme]
    count, k = chains.count, request.n_save + 1
    batch = Batch(
        np.linspace(0.0, request.duration, k),
        np.empty((count, k, request.observed.size)),
        np.empty((count, k)),
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.zeros(count, int),
        request.scheme,
        np.full(count, np.nan),
    )
    if not chains.fit_lanes or method.kind == "implicit":
        return _finished_singly(batch, chains, range(count), error, request, {})

    rate = fastest_contacts(chains, request.duration)
    speed = np.abs(chains.v0).max(axis=1)
    speed[speed == 0.0] = 1.0

    phase = pilot_phase(chains, rate, speed, error, request)

    # the coarse march of all chains in the lanes; those of more steps are marched singly
    wanted = request.duration * rate / phase
    rows, refused = np.flatnonzero(wanted < MAX_STEPS), {}
    wanted = wanted[rows]
    coarse = _march_by_steps(chains.take(rows), wanted / FIRST_RATIO, request)
    coarse_v, coarse_steps = coarse.v, coarse.n_steps

    # of refined chains also the difference of the coarse march from a coarser one; NaN before
    coarse_difference, coarser_steps = np.full((2, rows.size), np.nan)

    for _ in range(MAX_ROUNDS):
        chains_left = chains.take(rows)
        fine = _march_by_steps(chains_left, wanted, request)
        difference = _velocity_difference(fine.v, coarse_v, speed[rows])
        refined = ~np.isnan(coarse_difference)

        # a difference that has fallen faster than any scheme's is small by chance, as happens in
        # sensitive chains: it counts as if it had fallen by the fastest order
        fallen = coarse_difference / (coarse_steps / coarser_steps) ** FASTEST_ORDER
        difference = np.where(fallen < np.inf, np.maximum(difference, fallen), difference)

        # Richardson's estimate. For the first pair p is assumed; later it is the
        # order that two differences show, less a caution. Where differences hardly fall p is small
        # and e larger than the difference
        with np.errstate(divide="ignore", invalid="ignore"):
            fall = np.log(coarse_difference / difference)
            order = np.nan_to_num(fall / np.log(coarse_steps / coarser_steps), nan=0.0)
        order = np.clip(order - ORDER_CAUTION, SLOWEST_ORDER, LATER_ORDER)
        order = np.where(refined, order, FIRST_ORDER)
        ratio = fine.n_steps / coarse_steps
        estimate = richardson(difference, ratio, order)

        # of refined chains also the effect of rounding: the same march from velocities changed by
        # the length of a random walk of the roundings of all evaluations. The changes alternate in
        # sign, since changes of one sign would only scale all speeds
        again = np.flatnonzero(refined)
        if again.size:
            evaluations = fine.n_steps[again] * method.evaluations
            change = ROUNDING_WALK * EPSILON * np.sqrt(evaluations) * speed[rows[again]]
            changed = chains_left.take(again)
            signs = (-1.0) ** np.arange(changed.mass.shape[1])
            changed.arrays["v0"] = changed.v0 + change[:, None] * signs
            moved = _march_by_steps(changed, fine.n_steps[again], request)
            rounding = _velocity_difference(moved.v, fine.v[again], speed[rows[again]])
            estimate[again] = np.maximum(estimate[again], rounding)
            closed = fine.energy_error[again] <= error
            for i in again[closed & (rounding > ROUNDING_EXCESS * error)]:
                dt = request.duration / fine.n_steps[i]
                refused[int(rows[i])] = lost_in_rounding(error, estimate[i], dt)

        # chains within the error are finished
        excess = _excess(estimate, fine.energy_error, error)
        within = excess <= 1.0
        into = rows[within]
        if rows.size == count:
            batch = batch._replace(v=fine.v, wall_force=fine.wall_force)
        else:
            batch.v[into], batch.wall_force[into] = fine.v[within], fine.wall_force[within]
        batch.energy_error[into] = fine.energy_error[within]
        batch.n_steps[into] = fine.n_steps[within]
        batch.error_estimate[into] = estimate[within]
        missed = np.flatnonzero(~within & ~np.isin(rows, list(refused)))
        if not missed.size:
            break

        # next pairs of the others: a finer march against the same coarse one where few more steps
        # should do, else one of `first_ratio` times the steps against the fine march
        shorter = (ERROR_MARGIN * excess[missed]) ** (1.0 / STEP_ORDER)
        shorter = np.maximum(shorter, 1.15)
        same = ~refined[missed] & (ratio[missed] * shorter <= MAX_RATIO)
        wanted = fine.n_steps[missed] * np.where(same, shorter, FIRST_RATIO)
        coarse_v = np.where(same[:, None, None], coarse_v[missed], fine.v[missed])
        coarse_difference = np.where(same, coarse_difference[missed], difference[missed])
        coarser_steps = np.where(same, coarser_steps[missed], coarse_steps[missed])
        coarse_steps = np.where(same, coarse_steps[missed], fine.n_steps[missed])
        rows = rows[missed]

    batch.dt[:] = request.duration / np.where(batch.n_steps, batch.n_steps, np.nan)
    unfinished = np.flatnonzero(batch.n_steps == 0)
    batch.v[unfinished], batch.wall_force[unfinished] = np.nan, np.nan  # of refused chains
    singly = np.setdiff1d(unfinished, list(refused))
    return _finished_singly(batch, chains, singly, error, request, refused)


def fastest_contacts(chains: Chains, duration: float) -> Array:
    """Rate [1/s] of the fastest contact of each chain, (n_chains,), 1 / duration at least.

    The square is 3/2 A sqrt(d) (1/m_i + 1/m_{i+1}) with the overlap d that all kinetic energy
    leaves on top of the static force. Spheres alone: light wall modes make contacts stiff for
    stability, not for the accuracy of their solution.
    """
    v0, mass, A = chains.v0, chains.mass, chains.A
    energy = 0.5 * (mass * np.square(v0)).sum(axis=1, keepdims=True)
    n_falling = chains.chain.n_falling
    weight = np.abs((chains.gravity[:, None] * mass)[:, :n_falling].sum(axis=1, keepdims=True))
    pressed = chains.static[1] + 2.0 * weight
    depth = chains.elastic.overlap_of_energy(energy + 0.0 * A) + chains.elastic.overlap(pressed)
    inverse = 1.0 / mass
    pair = inverse.copy()
    pair[:, :-1] += inverse[:, 1:]
    square = (chains.elastic.stiffness(depth) * pair[:, : A.shape[1]]).max(axis=1, initial=0.0)
    return np.maximum(np.sqrt(square), 1.0 / duration)


def pilot_phase(chains, rate, speed, error, request) -> float:
    """Phase h * rate of the first steps, corrected by marches of a few chains: errors grow with
    duration, length and parts of the chain. rate [1/s] of the fastest contact and largest initial
    speed [m/s] of every chain, (n_chains,).

    The pilots are spread over the chains in order of their rates. Three rounds at most; chaotic
    ones, whose difference says nothing about the step, have no voice.
    """
    interval = stability_interval(SCHEMES[request.scheme])
    bold = BOLDNESS * (error / 1e-4) ** (1.0 / STEP_ORDER)
    phase = interval * min(bold, MAX_STEP_SHARE)

    spread = np.linspace(0, chains.count - 1, N_PILOTS).astype(int)
    pilot = np.argsort(rate)[spread]
    pilots = chains.take(pilot)
    for _ in range(3 if chains.count > 2 * N_PILOTS else 0):
        wanted = request.duration * rate[pilot] / phase
        coarse = _march_by_steps(pilots, wanted / FIRST_RATIO, request)
        fine = _march_by_steps(pilots, wanted, request)
        difference = _velocity_difference(fine.v, coarse.v, speed[pilot])
        estimate = difference / (FIRST_RATIO**FIRST_ORDER - 1.0)
        excess = _excess(estimate, fine.energy_error, error)
        telling = (difference < CHAOTIC_DIFFERENCE) | (coarse.energy_error > CHAOTIC_DIFFERENCE)
        worst = PILOT_ERROR
        if telling.any():
            worst = np.quantile(excess[telling], PILOT_SHARE, method="lower")
        longer = (PILOT_ERROR / max(worst, EPSILON)) ** (1.0 / STEP_ORDER)
        longer = min(np.clip(longer, *PILOT_BOUNDS), MAX_STEP_SHARE * interval / phase)
        phase *= longer
        if SETTLED_BOUNDS[0] < longer < SETTLED_BOUNDS[1]:
            break
    return phase


class _Marches(NamedTuple):
    """Results of chains by steps of their own."""

    v: Array  # (m, k, n_observed)
    wall_force: Array  # (m, k)
    energy_error: Array  # (m,)
    n_steps: Array  # (m,)


def _march_by_steps(chains, wanted, request):
    """The chains by about the wanted numbers of steps (m,): those that need like numbers march
    together, by the largest of them. NaN where steps are unstable."""
    n_steps = np.ceil(np.maximum(wanted, 1.0)).astype(int)
    order = np.argsort(-n_steps, kind="stable")
    count, k = chains.count, request.n_save + 1
    marches = _Marches(
        np.empty((count, k, request.observed.size)),
        np.empty((count, k)),
        np.full(count, np.inf),
        n_steps,
    )

    def march_group(rows):
        """March the chains of these rows by the most steps that any of them needs."""
        n_steps[rows] = n = n_steps[rows[0]]
        steps = LaneSteps(request.duration / n, int(n), request.n_save)
        method = SCHEMES[request.scheme]
        try:
            runs = march_side_by_side(chains.take(rows), method, steps, request.observed, 1)
        except UnstableStep:
            runs = LaneRuns(np.nan, np.nan, np.inf)
        marches.v[rows], marches.wall_force[rows] = runs.v, runs.wall_force
        marches.energy_error[rows] = runs.energy_error

    # an outlier's short steps are not forced on others
    groups, first = [], 0
    for i in range(1, count + 1):
        full = i == count or i - first == MAX_GROUP
        if full or n_steps[order[first]] > GROUP_SPREAD * n_steps[order[i]]:
            groups.append(order[first:i])
            first = i
    chains.static  # noqa: B018  once for all groups
    if request.threads == 1 or len(groups) == 1:
        for rows in groups:
            march_group(rows)
    else:
        with ThreadPoolExecutor(request.threads) as pool:
            list(pool.map(march_group, groups))
    return marches


def _velocity_difference(fine, coarse, speed):
    """(m,) largest difference of velocities (m, k, n_observed) over the initial speeds; inf where
    either is not finite."""
    difference = np.abs(fine - coarse).max(axis=(1, 2)) / speed
    return np.where(np.isfinite(difference), difference, np.inf)


def _excess(estimate, energy_error, error):
    """(m,) the worse of velocity and energy error over what is allowed."""
    energy = np.where(np.isfinite(energy_error), energy_error, np.inf)
    return np.maximum(estimate, energy / ENERGY_SHARE) / error


def _finished_singly(batch, chains, rows, error, request, refused):
    """The batch with these chains marched one by one, and what is refused."""

    def march_one(i):
        """March chain i to the error, or note why that is refused."""
        try:
            run = march_to_error(
                *chains[i], duration=request.duration, error=error, observed=request.observed,
                n_save=request.n_save, search=StepSearch(request.scheme),
            ).trajectory  # fmt: skip
        except UnstableStep as reason:
            refused[int(i)] = str(reason)
            batch.v[i], batch.wall_force[i] = np.nan, np.nan
            return
        batch.v[i], batch.wall_force[i] = run.v[:, request.observed], _wall_force(run, chains.wall)
        batch.energy_error[i], batch.error_estimate[i] = run.energy_error, run.error_estimate
        batch.dt[i], batch.n_steps[i] = run.dt, run.n_steps

    with ThreadPoolExecutor(request.threads) as pool:
        list(pool.map(march_one, rows))
    return batch._replace(refused=dict(sorted(refused.items())))


def _march(chains, dt, request):
    """All chains by equal steps up to dt; they end at the samples where those are farther apart.
    Raises UnstableStep."""
    if dt * request.n_save <= request.duration:
        steps = equal_steps(request.duration, dt, request.n_save)
        steps = LaneSteps(steps.h, steps.stride * request.n_save, request.n_save)
    else:
        n = int(np.ceil(request.duration / dt * (1 - 1e-9)))
        steps = LaneSteps(request.duration / n, n, request.n_save)
    t = np.linspace(0.0, request.duration, request.n_save + 1)
    method, observed = SCHEMES[request.scheme], request.observed

    # side by side where the lanes have all parts of the chains
    if chains.fit_lanes and method.kind != "implicit":
        runs = march_side_by_side(chains, method, steps, observed, request.threads)
        infinite = ~np.isfinite(runs.energy_error)
        if infinite.any():
            raise UnstableStep(
                f"chain {int(infinite.argmax())} of the batch is not finite with "
                f"dt = {steps.h:.3g} s; take a smaller dt"
            )
        return Batch(t, *runs, steps.h, steps.n_steps, request.scheme)

    # else one by one, at the ends of the steps where samples lie between these
    at_steps = steps.n_steps < request.n_save

    def march_one(i):
        """Observed velocities, wall force and energy error of chain i."""
        chain, wall, v0 = chains[i]
        run = march(
            chain, wall, v0, duration=request.duration, dt=dt, scheme=request.scheme,
            n_save=steps.n_steps if at_steps else request.n_save,
        )  # fmt: skip
        v, force = run.v[:, observed], _wall_force(run, wall)
        if at_steps:
            # samples between the steps, from the accelerations m a = steady + f_i - f_{i+1} - k u
            stiffness, anchor = chain.springs
            contacts = np.pad(run.contact_force, ((0, 0), (1, wall is None)))
            net = chain.steady - np.diff(contacts, axis=1) - stiffness * (run.x - anchor)
            a = (net / chain.mass)[:, observed]
            v = velocities_between(run.x[:, observed], v, a, steps.h, request.n_save)
            force = values_between(force, request.n_save)
        return v, force, run.energy_error

    with ThreadPoolExecutor(request.threads) as pool:
        results = zip(*pool.map(march_one, range(chains.count)), strict=True)
        v, wall_force, energy_error = map(np.array, results)
    return Batch(t, v, wall_force, energy_error, steps.h, steps.n_steps, request.scheme)


def _wall_force(run, wall):
    """(k,) [N] at the wall of a run, 0 without one."""
    return np.zeros(run.t.size) if wall is None else run.contact_force[:, -1]
