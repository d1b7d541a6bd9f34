"""Many chains at once: equal in length and wall modes, different in everything else.

Chains lie side by side in the lanes of vector registers and in blocks on the threads: Hertz
contacts, dissipation, preload, weight, leaf springs, walls without or with modes and a residual
spring. Chains with yield, friction or a dashpot, and those of implicit schemes as the linear
dampers take, are marched one by one, dealt to the threads. Steps do not stop at the samples, which
lie on polynomials of the steps.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.chain import LAWS, PER_SPHERE, Chain, Wall, validate
from dem.checks import InvalidChain, columns, positive, saves, whole
from dem.dense import values_between, velocities_between
from dem.kernels.arguments import Array
from dem.kernels.lanes import (
    LANES,
    Blocks,
    Dampers,
    Held,
    LaneSteps,
    SavedLanes,
    WallSprings,
    march_lanes,
)
from dem.kernels.oscillators import oscillator_propagator
from dem.prepared import prepare
from dem.schemes import SCHEMES, named_scheme
from dem.stability import (
    UnstableStep,
    fastest_rate,
    marching_scheme,
    refuse_step,
    stability_interval,
)
from dem.statics import approach, static_state
from dem.step_control import Search, march_to_error
from dem.trajectory import equal_steps, march


class Batch(NamedTuple):
    """What many marches leave: n_chains chains, k saves.

    To an error, every chain has steps of its own, and those that cannot be brought to it are NaN,
    with the reason in `refused`.
    """

    t: Array  # (k,)
    v: Array  # (n_chains, k, n_observed)
    wall_force: Array  # (n_chains, k), 0 for free chains
    energy_error: Array  # (n_chains,) largest change over the energy at the start
    dt: float | Array  # [s] as given, or (n_chains,) found for the error
    n_steps: int | Array
    scheme: str
    error_estimate: Array | None = None  # (n_chains,) relative velocity errors
    refused: Mapping[int, str] = MappingProxyType({})  # chains that miss the error, and why


def march_batch(
    chains: "Chains",
    *,
    duration: float,
    dt: float | None = None,
    error: float | None = None,
    observed: Sequence[int] | None = None,
    scheme: str | None = None,
    n_save: int = 100,
    threads: int | None = None,
) -> Batch:
    """Chains that start from their static state, marched side by side.

    Give dt, or the velocity error relative to the largest initial speed of each chain: the step of
    each is then found, and its error estimated, by marches of that chain. Raises InvalidChain,
    NoEquilibrium, UnstableStep (of a given dt).
    """
    if (dt is None) == (error is None):
        raise InvalidChain("give either dt or error to say how finely to march")
    scheme = _scheme(chains, scheme, duration)
    observed = columns(observed, chains.mass.shape[1])
    saves(n_save, chains.mass.size)
    positive("duration", duration, " s")
    positive("dt" if error is None else "error", dt if error is None else error)
    if threads is not None:
        whole("threads", threads)
    asked = _Asked(duration, n_save, observed, scheme, threads or os.cpu_count() or 1)
    return _to_error(chains, error, asked) if dt is None else _march(chains, dt, asked)


class _Asked(NamedTuple):
    """What is asked of a batch."""

    duration: float
    n_save: int
    observed: Array
    scheme: str
    threads: int

    def batch(self, dt: float, v: Array, wall_force: Array, errors: Array) -> Batch:
        """What marches by steps up to dt have left."""
        steps, t = self.steps(dt), np.linspace(0.0, self.duration, self.n_save + 1)
        return Batch(t, v, wall_force, errors, steps.h, steps.n_steps, self.scheme)

    def steps(self, dt: float) -> LaneSteps:
        """Equal ones up to dt, which end at the samples where those are farther apart."""
        if dt * self.n_save <= self.duration:
            steps = equal_steps(self.duration, dt, self.n_save)
            return LaneSteps(steps.h, steps.stride * self.n_save, self.n_save)
        n = int(np.ceil(self.duration / dt * (1 - 1e-9)))
        return LaneSteps(self.duration / n, n, self.n_save)


FAR = 4.0  # coarse over fine steps of a first pair: the coarse march adds a quarter of the cost
FARTHEST = 8.0  # of a fine march that is repeated with shorter steps beside the same coarse one
# Order by which the difference of a pair is taken to fall. Between steps velocities lie on
# polynomials, off by order 2.5 where a contact opens or closes in the step; the march itself keeps
# 3.5. Differences scatter: of 7000 random rows the error was above the difference over 8 in two,
# above that over 13 in 20, never above 2.7 times that. 4^FIRST - 1 = 13, 4^LATER - 1 = 4, as chains
# that have to be refined are sensitive. THEORY is what coarse marches show, for the next step.
FIRST, LATER, THEORY = 1.9, 1.16, 3.0
BELOW, SLOWEST = 0.5, 0.5  # below the order that refined steps show, which scatters; least of it
FASTEST = 4.0  # order by which differences of refined steps are believed to fall at the most
BOLDNESS, LONGEST = 0.055, 0.15  # first steps over the stability interval at error 1e-4; at most
PILOTS, SHARE, WITHIN = 16, 0.95, 0.6  # chains of a pilot; share of them to be within 0.6 error
LONGER, SHORTER = 3.0, 0.25  # at most, by a pilot
SETTLED = (0.6, 1.6)  # longer by a pilot: not worth another one
CHAOTIC = 1e-2  # difference beyond which a chain says nothing on first steps, if its energy is kept
ALIKE, UNLIKE = 64, 2.0  # chains that march together at most, and their numbers of steps apart
ROUNDS = 5  # of marches, before the search of a single run takes over
MOST_STEPS = 1e6  # of a chain in the lanes
MARGIN = 1.6  # in the error, of steps that are to reach it
SCATTER = 3.0  # times the root of its evaluations, of rounding in a march
LOST = 30.0  # times the error, that rounding leaves where no step can reach it
CLOSED = 0.1  # of the error asked for, that steps may leave in the energy
EPSILON = float(np.finfo(float).eps)
PER_CHAIN = ("preload", "gravity")
PER_CONTACT = PER_SPHERE
PER_WALL = ("residual_compliance", "mobility")
PER_MODE = ("omega", "zeta", "phi")


class Chains:
    """Chains of a batch with their walls and initial velocities.

    Fields of chain and wall and v0 have a leading axis n_chains, or lack it and are shared;
    preload, gravity, residual compliance and mobility are scalars or one per chain, the name of
    the dissipation and the number of spheres in flight are shared. Raises InvalidChain.
    """

    def __init__(self, chain: Chain, wall: Wall | None, v0: ArrayLike) -> None:
        self.chain, self.wall = chain, wall
        fields = _fields(chain, PER_CHAIN, PER_CONTACT) | {"v0": (np.asarray(v0, float), 2)}
        if wall is not None:
            fields |= _fields(wall, PER_WALL, PER_MODE)
        counts = {
            name: values.shape[0] for name, (values, full) in fields.items() if values.ndim == full
        }
        self.count = max(counts.values(), default=1)
        for name, found in counts.items():
            if found not in (1, self.count):
                raise InvalidChain(
                    f"{name} is given for {found} chains, others for {self.count}; give as many"
                )
        self.arrays = {
            name: np.broadcast_to(values, (self.count, *values.shape[values.ndim - full + 1 :]))
            for name, (values, full) in fields.items()
        }
        for i in {0, self.count - 1}:
            validate(*self[i])
        bad = [name for name, values in self.arrays.items() if not np.isfinite(values).all()]
        if bad or (self.arrays["A"] <= 0).any() or (self.arrays["mass"] <= 0).any():
            raise InvalidChain(
                f"a chain of the batch has {bad[0] if bad else 'a mass or A'} that is not finite "
                "or not above 0"
            )

    def __getitem__(self, i):
        own = {name: values[i].copy() for name, values in self.arrays.items()}
        v0 = own.pop("v0")
        steady = {name: float(own.pop(name)) for name in PER_CHAIN}
        numbers = {name: float(own.pop(name)) for name in PER_WALL if name in own}
        modes = {name: own.pop(name) for name in PER_MODE if name in own}
        one = self.chain._replace(**own, **steady)
        wall = None if self.wall is None else self.wall._replace(**modes, **numbers)
        return one, wall, v0

    def __getattr__(self, name):
        return self.arrays[name]

    @property
    def fit_lanes(self) -> bool:
        """Without any part that the lanes do not know."""
        creeps = np.any(self.arrays.get("mobility", 0.0))
        return not (creeps or self.chain.yield_overlap is not None or self.chain.slides)

    @property
    def free(self) -> bool:
        """Without a wall."""
        return self.wall is None

    @property
    def damped(self) -> bool:
        """With dissipation in any contact."""
        return self.chain.dissipation != "none" and bool(self.gamma.any())

    @property
    def most_damped(self) -> int:
        """The chain with the largest coefficient, 0 where none has any."""
        return int(self.gamma.max(axis=1).argmax()) if self.damped else 0

    @cached_property
    def static(self) -> tuple[Array, Array, Array]:
        """Positions (n_chains, n), contact forces and displacements of the modes at rest."""
        return _static(self)

    def take(self, rows: Array) -> "Chains":
        """The chains of these rows."""
        part = object.__new__(Chains)
        part.chain, part.wall, part.count = self.chain, self.wall, len(rows)
        part.arrays = {name: values[rows] for name, values in self.arrays.items()}
        if "static" in self.__dict__:
            part.__dict__["static"] = tuple(values[rows] for values in self.static)
        return part


def _fields(parts, scalars, vectors):
    """Values of the fields that are there, and how many axes they have where chains differ."""
    axes = dict.fromkeys(scalars, 1) | dict.fromkeys(vectors, 2)
    return {
        name: (np.asarray(getattr(parts, name), float), n)
        for name, n in axes.items()
        if getattr(parts, name) is not None
    }


def _scheme(chains, name, duration):
    """What suits the most damped chain."""
    chain, wall, v0 = chains[chains.most_damped]
    if not chains.damped:
        return named_scheme(name, chain, wall).name
    prepared = prepare(chain, wall)
    rate = max(fastest_rate(prepared, v0), 1.0 / duration)
    return marching_scheme(prepared, v0, 1.0 / (3.0 * rate), name).name


def _to_error(chains, error, asked):
    """Every chain to the error by steps of its own, judged by its own marches.

    First steps are the same share of the period of each chain's fastest contact, the share that
    the chains of a pilot need. A chain that misses the error is marched by shorter steps, beside
    the same coarse march where little is missing, else beside its last one. Chains that do not get
    there are left to `march_to_error`, except those that make far more than the error of rounding:
    no step mends that.
    """
    batch, method = _room(chains.count, asked), SCHEMES[asked.scheme]
    if not chains.fit_lanes or method.kind == "implicit":
        return _singly(chains, range(chains.count), error, asked, batch, {})
    rate = np.maximum(_fastest_rates(chains), 1.0 / asked.duration)
    speed = np.abs(chains.v0).max(axis=1)
    speed[speed == 0.0] = 1.0
    interval = stability_interval(method)
    phase = interval * min(BOLDNESS * (error / 1e-4) ** (1.0 / THEORY), LONGEST)

    # a pilot corrects the first steps: errors grow with duration, length and parts of the chain
    pilot = np.argsort(rate)[np.linspace(0, chains.count - 1, PILOTS).astype(int)]
    part = chains.take(pilot)
    for _ in range(3 if chains.count > 2 * PILOTS else 0):
        wanted = asked.duration * rate[pilot] / phase
        coarse = _marched(part, wanted / FAR, asked)
        fine = _marched(part, wanted, asked)
        difference = _apart(fine.v, coarse.v, speed[pilot])
        excess = _excess(difference / (FAR**FIRST - 1.0), fine.energy_error, error)
        telling = (difference < CHAOTIC) | (coarse.energy_error > CHAOTIC)
        most = np.quantile(excess[telling], SHARE, method="lower") if telling.any() else WITHIN
        longer = np.clip((WITHIN / max(most, EPSILON)) ** (1.0 / THEORY), SHORTER, LONGER)
        longer = min(longer, LONGEST * interval / phase)
        phase *= longer
        if SETTLED[0] < longer < SETTLED[1]:
            break

    wanted = asked.duration * rate / phase
    rows, refused = np.flatnonzero(wanted < MOST_STEPS), {}
    wanted = wanted[rows]
    first = _marched(chains.take(rows), wanted / FAR, asked)
    coarse = _Coarse(first.v, first.n_steps, *np.full((2, rows.size), np.nan))
    for _ in range(ROUNDS):
        part = chains.take(rows)
        fine = _marched(part, wanted, asked)
        difference = _apart(fine.v, coarse.v, speed[rows])
        # falling faster than any scheme here, it is small by chance: of chains sensitive to all
        fallen = coarse.difference / (coarse.n_steps / coarse.coarser) ** FASTEST
        difference = np.where(fallen < np.inf, np.maximum(difference, fallen), difference)
        ratio = fine.n_steps / coarse.n_steps
        estimate = difference / (ratio ** _order(coarse, difference) - 1.0)

        # of refined chains also what they make of rounding
        again = np.flatnonzero(coarse.refined)
        if again.size:
            rounding = _rounding(part.take(again), fine.take(again), speed[rows[again]], asked)
            estimate[again] = np.maximum(estimate[again], rounding)
            kept = fine.energy_error[again] <= error
            for i in again[kept & (rounding > LOST * error)]:
                refused[int(rows[i])] = _lost(error, estimate[i], asked.duration / fine.n_steps[i])

        excess = _excess(estimate, fine.energy_error, error)
        done = excess <= 1.0
        into = rows[done]
        if rows.size == chains.count:
            batch = batch._replace(v=fine.v, wall_force=fine.wall_force)
        else:
            batch.v[into], batch.wall_force[into] = fine.v[done], fine.wall_force[done]
        batch.energy_error[into], batch.n_steps[into] = fine.energy_error[done], fine.n_steps[done]
        batch.error_estimate[into] = estimate[done]

        missed = np.flatnonzero(~done & ~np.isin(rows, list(refused)))
        if not missed.size:
            break
        shorter = np.maximum((MARGIN * excess[missed]) ** (1.0 / THEORY), 1.15)
        near = ~coarse.refined[missed] & (ratio[missed] * shorter <= FARTHEST)
        wanted = fine.n_steps[missed] * np.where(near, shorter, FAR)
        finer = _Coarse(fine.v, fine.n_steps, difference, coarse.n_steps).take(missed)
        coarse = coarse.take(missed).where(near, finer)
        rows = rows[missed]
    batch.dt[:] = asked.duration / np.where(batch.n_steps, batch.n_steps, np.nan)
    without = np.flatnonzero(batch.n_steps == 0)
    batch.v[without], batch.wall_force[without] = np.nan, np.nan  # of refused chains
    left = np.setdiff1d(without, list(refused))
    return _singly(chains, left, error, asked, batch, refused)


class _Marches(NamedTuple):
    """What chains by steps of their own leave."""

    v: Array  # (m, k, n_observed)
    wall_force: Array  # (m, k)
    energy_error: Array  # (m,)
    n_steps: Array  # (m,)

    def take(self, rows: Array) -> "_Marches":
        return _Marches(*(part[rows] for part in self))


class _Coarse(NamedTuple):
    """Marches that finer ones are compared with."""

    v: Array  # (m, k, n_observed)
    n_steps: Array  # (m,)
    difference: Array  # (m,) from coarser ones yet, NaN for the first
    coarser: Array  # (m,) steps of these

    @property
    def refined(self) -> Array:
        return ~np.isnan(self.difference)

    def take(self, rows: Array) -> "_Coarse":
        return _Coarse(*(part[rows] for part in self))

    def where(self, same: Array, other: "_Coarse") -> "_Coarse":
        """Itself for some chains, another one for the rest."""
        pairs = zip(self, other, strict=True)
        return _Coarse(
            *(np.where(same.reshape(-1, *[1] * (one.ndim - 1)), one, two) for one, two in pairs)
        )


def _order(coarse, difference):
    """By which errors fall: assumed for a first pair, where two differences are known below the
    one they show. Differences that hardly fall count in full and more."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shown = np.log(coarse.difference / difference) / np.log(coarse.n_steps / coarse.coarser)
    believed = np.clip(np.nan_to_num(shown, nan=0.0) - BELOW, SLOWEST, LATER)
    return np.where(coarse.refined, believed, FIRST)


def _apart(fine, coarse, speed):
    """(m,) largest difference of velocities over the initial speeds; inf where there is none."""
    difference = np.abs(fine - coarse).max(axis=(1, 2)) / speed
    return np.where(np.isfinite(difference), difference, np.inf)


def _excess(estimate, energy_error, error):
    """(m,) the worse of velocity and energy over what is allowed."""
    energy = np.where(np.isfinite(energy_error), energy_error, np.inf)
    return np.maximum(estimate, energy / CLOSED) / error


def _rounding(chains, found, speed, asked):
    """(m,) largest change of velocities by one of the initial velocities as large as rounding."""
    evaluations = found.n_steps * SCHEMES[asked.scheme].evaluations
    change = SCATTER * EPSILON * np.sqrt(evaluations) * speed
    signs = (-1.0) ** np.arange(chains.mass.shape[1])  # of one sign, a mere scale of speeds
    other = chains.take(np.arange(chains.count))
    other.arrays["v0"] = chains.v0 + change[:, None] * signs
    moved = _marched(other, found.n_steps, asked)
    return _apart(moved.v, found.v, speed)


def _lost(error, rounding, dt):
    return (
        f"error {error:g} is not reached, rounding alone leaves up to {rounding:.2g} with "
        f"dt = {dt:.3g} s; ask for a larger error or less time"
    )


def _marched(chains, wanted, asked):
    """The chains by about the wanted numbers of steps (m,): those that need like numbers march
    together, by the largest of them. NaN where steps are unstable."""
    n_steps = np.ceil(np.maximum(wanted, 1.0)).astype(int)
    order = np.argsort(-n_steps, kind="stable")
    found = _Marches(
        np.empty((chains.count, asked.n_save + 1, asked.observed.size)),
        np.empty((chains.count, asked.n_save + 1)),
        np.full(chains.count, np.inf),
        n_steps,
    )

    def work(rows):
        n_steps[rows] = n = n_steps[rows[0]]
        steps = LaneSteps(asked.duration / n, int(n), asked.n_save)
        try:
            _lanes(chains.take(rows), steps, asked, 1, *found[:3], rows)
        except UnstableStep:
            found.v[rows] = found.wall_force[rows] = np.nan

    # an outlier's short steps are not forced on others
    groups, first = [], 0
    for i in range(1, chains.count + 1):
        full = i == chains.count or i - first == ALIKE
        if full or n_steps[order[first]] > UNLIKE * n_steps[order[i]]:
            groups.append(order[first:i])
            first = i
    chains.static  # noqa: B018  once for all groups
    if asked.threads == 1 or len(groups) == 1:
        for rows in groups:
            work(rows)
        return found
    with ThreadPoolExecutor(asked.threads) as pool:
        list(pool.map(work, groups))
    return found


def _fastest_rates(chains):
    """(m,) [rad/s] `fastest_rate` of the spheres alone: light wall modes make contacts stiff for
    stability, not for the accuracy of their solution."""
    v0, mass, A = chains.v0, chains.mass, chains.A
    energy = 0.5 * (mass * np.square(v0)).sum(axis=1, keepdims=True)
    falling = chains.chain.n_falling
    weight = np.abs((chains.gravity[:, None] * mass)[:, :falling].sum(axis=1, keepdims=True))
    pressed = chains.static[1] + 2.0 * weight
    depth = (2.5 * energy / A) ** 0.4 + (pressed / A) ** (2.0 / 3.0)
    inverse = 1.0 / mass
    pair = inverse.copy()
    pair[:, :-1] += inverse[:, 1:]
    return np.sqrt((1.5 * A * np.sqrt(depth) * pair[:, : A.shape[1]]).max(axis=1, initial=0.0))


def _room(count, asked):
    """A batch to be filled."""
    k = asked.n_save + 1
    return Batch(
        np.linspace(0.0, asked.duration, k),
        np.empty((count, k, asked.observed.size)),
        np.empty((count, k)),
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.zeros(count, int),
        asked.scheme,
        np.full(count, np.nan),
    )


def _singly(chains, rows, error, asked, batch, refused):
    """The batch with these chains marched one by one, and what is refused."""

    def one(i):
        try:
            run = march_to_error(
                *chains[i], duration=asked.duration, error=error, observed=asked.observed,
                n_save=asked.n_save, search=Search(asked.scheme),
            ).trajectory  # fmt: skip
        except UnstableStep as reason:
            refused[int(i)] = str(reason)
            batch.v[i], batch.wall_force[i] = np.nan, np.nan
            return
        batch.v[i], batch.wall_force[i] = run.v[:, asked.observed], _wall_force(run, chains.wall)
        batch.energy_error[i], batch.error_estimate[i] = run.energy_error, run.error_estimate
        batch.dt[i], batch.n_steps[i] = run.dt, run.n_steps

    with ThreadPoolExecutor(asked.threads) as pool:
        list(pool.map(one, rows))
    return batch._replace(refused=dict(sorted(refused.items())))


def _march(chains, dt, asked):
    """All chains by steps up to dt."""
    if not chains.fit_lanes or SCHEMES[asked.scheme].kind == "implicit":
        return _one_by_one(chains, dt, asked)
    steps = asked.steps(dt)
    v = np.empty((chains.count, steps.n_save + 1, asked.observed.size))
    force, energy_error = np.empty(v.shape[:2]), np.empty(chains.count)
    _lanes(chains, steps, asked, asked.threads, v, force, energy_error, np.arange(chains.count))
    _require_finite(energy_error, steps.h)
    return asked.batch(dt, v, force, energy_error)


def _lanes(chains, steps, asked, threads, v, wall_force, energy_error, rows):
    """Fill these rows of what is kept of a march side by side; raises UnstableStep."""
    method = SCHEMES[asked.scheme]
    if chains.damped:
        chain, wall, v0 = chains[chains.most_damped]
        refuse_step(prepare(chain, wall), v0, steps.h, method)
    blocks = _blocks(chains, steps.h * method.a)
    n, k = len(blocks.v0), steps.n_save + 1
    saved = SavedLanes(
        np.empty((n, k, asked.observed.size, LANES)),
        np.empty((n, k, LANES)),
        np.zeros((n, LANES)),
    )

    def work(part):
        own, into = _part(blocks, part), _part(saved, part)
        march_lanes(own, method.a, method.b, method.correction, steps, asked.observed, into)

    _share(work, n, threads)
    for block, first in enumerate(range(0, chains.count, LANES)):
        into = rows[first : first + LANES]
        v[into] = saved.v[block].transpose(2, 0, 1)[: into.size]
        wall_force[into] = saved.wall_force[block].T[: into.size]
        energy_error[into] = saved.energy_error[block][: into.size]


def _part(whole, rows):
    """The same rows of every array of a tuple of arrays and such tuples."""
    parts = (_part(a, rows) if isinstance(a, tuple) else a[rows] for a in whole)
    return type(whole)(*parts)


def _blocks(chains, drifts):
    none = np.zeros((chains.count, 0))
    A, stiffness = chains.A, chains.arrays.get("leaf_stiffness", none)
    if chains.free:
        A = np.concatenate([A, np.zeros((chains.count, 1))], axis=1)
    modes = (chains.arrays.get(name, none) for name in ("phi", "omega", "zeta"))
    parts = (chains.v0, chains.mass, A, *modes)
    v0, mass, A, phi, omega, zeta = map(_packed, parts)
    swing = _packed(np.sqrt(stiffness / chains.mass) if stiffness.any() else none)
    return Blocks(
        v0, mass, A, phi, omega, _propagator(omega, zeta, drifts), _held(chains),
        _propagator(swing, np.zeros_like(swing), drifts),
        _springs(chains), _dampers(chains, len(v0)),
    )  # fmt: skip


def _springs(chains):
    s = chains.arrays.get("residual_compliance", np.zeros(0))[:, None]
    if not s.any():
        none = _packed(np.zeros((chains.count, 0)))
        return WallSprings(none, none)
    e = np.minimum(s * chains.A[:, -1:], 0.0)
    fold = np.divide(-2.0, 3.0 * e, out=np.full_like(e, np.inf), where=e < 0.0)
    return WallSprings(_packed(s), _packed(fold))


def _dampers(chains, n_blocks):
    law = np.full(n_blocks, LAWS[chains.chain.dissipation])
    if not chains.damped:
        none = np.zeros((n_blocks, 0, LANES))
        return Dampers(none, none, law)
    inverse, gamma = 1.0 / chains.mass, chains.gamma
    pair = inverse + np.roll(inverse, -1, axis=1)
    if chains.free:
        gamma = np.pad(gamma, ((0, 0), (0, 1)))
    else:
        pair[:, -1] = inverse[:, -1] + np.square(chains.phi).sum(axis=1)
    return Dampers(_packed(gamma), _packed(pair), law)


def _held(chains):
    """The static states; empty for chains that nothing presses or holds."""
    none, preload = np.zeros((chains.count, 0)), chains.preload[:, None]
    stiffness = chains.arrays.get("leaf_stiffness", none)
    weight = chains.gravity[:, None] * chains.mass if chains.gravity.any() else none
    if not (preload.any() or stiffness.any() or weight.any()):
        return Held(*map(_packed, [none] * len(Held._fields)))
    rest, force, modes = chains.static
    anchor = chains.arrays.get("leaf_anchor", np.zeros_like(chains.mass))
    at_wall = force[:, -1:] if not chains.free else np.zeros_like(preload)
    ends = np.zeros_like(preload)
    all_forces = np.hstack([ends, force, ends] if chains.free else [ends, force])
    offset = (chains.phi * modes).sum(axis=1, keepdims=True) if modes.size else ends
    leaf = (stiffness, anchor) if stiffness.any() else (none, none)
    load, falling = np.diff(all_forces), chains.chain.n_falling
    load[:, :falling] = weight[:, :falling] if weight.any() else 0.0
    parts = (rest, load, offset, at_wall, modes, preload, weight, *leaf)
    return Held(*map(_packed, parts))


def _static(chains):
    """Positions (n_chains, n), contact forces and displacements of the modes at rest."""
    preload, phi = chains.preload, chains.arrays.get("phi")
    springs = chains.arrays.get("leaf_stiffness")
    if not (preload.any() or np.any(springs) or chains.gravity.any()):
        modes = np.zeros((chains.count, 0 if phi is None else phi.shape[1]))
        return np.zeros_like(chains.mass), np.zeros_like(chains.A), modes
    only_preload = not (chains.free or np.any(springs) or chains.gravity.any())
    if only_preload and not ((preload < 0.0).any() or (chains.omega == 0).any()):
        response = phi / chains.omega**2
        compliance = (phi * response).sum(axis=1) + chains.residual_compliance
        x = approach(chains.A[:, -1], preload, compliance)[:, None]
        alone = np.arange(chains.mass.shape[1]) == chains.mass.shape[1] - 1
        if (compliance >= 0.0).all():
            return x + 0.0 * chains.mass, preload[:, None] * alone, response * preload[:, None]
    static = [static_state(*chains[i][:2]) for i in range(chains.count)]
    return tuple(np.array(parts) for parts in zip(*static, strict=True))


def _propagator(omega, zeta, drifts):
    """(n_blocks, n_drifts, 4, n_modes * LANES) of `oscillator_propagator`."""
    blocks, k = omega.shape[:2]
    found = np.zeros((blocks, drifts.size, 4, k * LANES))
    for i, drift in enumerate(drifts if k else []):
        moved = oscillator_propagator(omega, zeta, drift)
        found[:, i] = moved.reshape(4, blocks, -1).transpose(1, 0, 2)
    return found


def _require_finite(errors, h):
    if not np.isfinite(errors).all():
        raise UnstableStep(
            f"chain {int((~np.isfinite(errors)).argmax())} of the batch is not finite with "
            f"dt = {h:.3g} s; take a smaller dt"
        )


def _one_by_one(chains, dt, asked):
    steps = asked.steps(dt)
    at_steps = steps.n_steps < asked.n_save

    def one(i):
        chain, wall, v0 = chains[i]
        run = march(
            chain, wall, v0, duration=asked.duration, dt=dt, scheme=asked.scheme,
            n_save=steps.n_steps if at_steps else asked.n_save,
        )  # fmt: skip
        v, force = run.v[:, asked.observed], _wall_force(run, wall)
        if at_steps:
            a = _accelerations(chain, wall, run)[:, asked.observed]
            v = velocities_between(run.x[:, asked.observed], v, a, steps.h, asked.n_save)
            force = values_between(force, asked.n_save)
        return v, force, run.energy_error

    with ThreadPoolExecutor(asked.threads) as pool:
        each = zip(*pool.map(one, range(chains.count)), strict=True)
        return asked.batch(dt, *map(np.array, each))


def _wall_force(run, wall):
    return np.zeros(run.t.size) if wall is None else run.contact_force[:, -1]


def _accelerations(chain, wall, run):
    """(k, n) [m/s^2] of a run's spheres by the forces on them."""
    stiffness, anchor = chain.springs
    force = np.pad(run.contact_force, ((0, 0), (1, wall is None)))
    pushed = chain.steady - np.diff(force, axis=1) - stiffness * (run.x - anchor)
    return pushed / chain.mass


def _packed(values):
    """(n_blocks, m, LANES) of (n_chains, m), the last block filled up with its last chain."""
    blocks = -(-values.shape[0] // LANES)
    rows = np.minimum(np.arange(blocks * LANES), values.shape[0] - 1)
    return np.ascontiguousarray(values[rows].reshape(blocks, LANES, -1).transpose(0, 2, 1))


def _share(work, n_blocks, threads):
    """Blocks dealt to threads in pieces."""
    pieces = [slice(i, i + 4) for i in range(0, n_blocks, 4)]
    if threads == 1 or len(pieces) == 1:
        for piece in pieces:
            work(piece)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, pieces))
