"""Many chains at once: equal in length and wall modes, different in everything else.

Chains lie side by side in the lanes of vector registers and in blocks on the threads: Hertz
contacts, dissipation, preload, weight, leaf springs, walls without or with modes and a residual
spring. Chains with yield, friction or a dashpot, and those of implicit schemes as the linear
dampers take, are marched one by one, dealt to the threads. Steps do not stop at the samples, which
lie on polynomials of the steps.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
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
    """What many marches leave: n_chains chains, k saves."""

    t: Array  # (k,)
    v: Array  # (n_chains, k, n_observed)
    wall_force: Array  # (n_chains, k), 0 for free chains
    energy_error: Array  # (n_chains,) largest change over the energy at the start
    dt: float
    n_steps: int
    scheme: str
    error_estimate: float | None = None  # relative velocity error of the sampled chains


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

    Give dt, or the velocity error relative to the largest initial speed: the step is then found on
    the stiffest chain and the estimate taken from up to 16 chains. Raises InvalidChain,
    NoEquilibrium, UnstableStep.
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


SEARCHED = 100  # samples at which a step is sought: more would make it short for their own sake
STABLE = 0.5  # of the largest stable step of the stiffest chain
CAUTION, MOST_LONGER, WORTH = 0.8, 4.0, 1.25  # times longer
EPSILON = float(np.finfo(float).eps)
CLOSED = 0.1  # of the error asked for, that a longer step may leave in the energy
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

    def take(self, rows: Array) -> "Chains":
        """The chains of these rows."""
        part = object.__new__(Chains)
        part.chain, part.wall, part.count = self.chain, self.wall, len(rows)
        part.arrays = {name: values[rows] for name, values in self.arrays.items()}
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
    stiffest = int(chains.A.max(axis=1).argmax())
    dt = march_to_error(
        *chains[stiffest], duration=asked.duration, error=error, observed=asked.observed,
        n_save=min(asked.n_save, SEARCHED), search=Search(asked.scheme, energy_error=np.inf),
    ).trajectory.dt  # fmt: skip
    spread = np.linspace(0, chains.count - 1, 16).astype(int)
    sample = chains.take(np.union1d(spread, [stiffest, chains.most_damped]))
    found = _sampled(sample, dt, asked)
    while found.estimate > error:
        found = _sampled(sample, found.dt / 1.5, asked)
    if chains.fit_lanes and SCHEMES[asked.scheme].kind != "implicit":
        found = _longer(sample, found, _longest(chains[stiffest], asked), error, asked)
    return _march(chains, found.dt, asked)._replace(error_estimate=found.estimate)


class _Sampled(NamedTuple):
    """What some of the chains say of a step."""

    dt: float
    estimate: float  # of the velocity error
    energy_error: float


def _sampled(sample, dt, asked):
    coarse = _march(sample, dt, asked)
    fine = _march(sample, coarse.dt / 2, asked)
    speed = np.abs(sample.v0).max(axis=1)[:, None, None]
    # the coarse step is the one used: its error is the whole difference
    estimate = float((np.abs(fine.v - coarse.v) / speed).max()) * 1.25
    return _Sampled(coarse.dt, estimate, float(coarse.energy_error.max()))


def _longest(one, asked):
    """The step [s] that a sample is no judge of any more: it may be unstable for other chains."""
    chain, wall, v0 = one
    rate = max(fastest_rate(prepare(chain, wall), v0), 1.0 / asked.duration)
    return STABLE * stability_interval(SCHEMES[asked.scheme]) / rate


def _longer(sample, found, longest, error, asked):
    """The step, or a longer one that keeps the error: that sought behind a wall with fast light
    modes is often much too short."""
    while True:
        spent = max(found.estimate, found.energy_error / CLOSED, EPSILON) / error
        allowed = CAUTION * spent ** (-1.0 / SCHEMES[asked.scheme].order)
        share = min(allowed, MOST_LONGER, longest / found.dt)
        if share < WORTH:
            return found
        other = _sampled(sample, share * found.dt, asked)
        kept = other.estimate <= error and other.energy_error <= CLOSED * error
        if not kept or other.dt < WORTH * found.dt:  # samples may leave no room for a longer one
            return other if kept else found
        found = other


def _march(chains, dt, asked):
    method = SCHEMES[asked.scheme]
    if not chains.fit_lanes or method.kind == "implicit":
        return _one_by_one(chains, dt, asked)
    steps = asked.steps(dt)
    if chains.damped:
        chain, wall, v0 = chains[chains.most_damped]
        refuse_step(prepare(chain, wall), v0, steps.h, method)
    blocks = _blocks(chains, steps.h * method.a)
    n, k = len(blocks.v0), asked.n_save + 1
    saved = SavedLanes(
        np.empty((n, k, asked.observed.size, LANES)),
        np.empty((n, k, LANES)),
        np.zeros((n, LANES)),
    )

    def work(part):
        own, into = _part(blocks, part), _part(saved, part)
        march_lanes(own, method.a, method.b, method.correction, steps, asked.observed, into)

    _share(work, n, asked.threads)
    v = saved.v.transpose(0, 3, 1, 2).reshape(n * LANES, k, -1)
    force = saved.wall_force.transpose(0, 2, 1).reshape(n * LANES, k)
    found = (values[: chains.count] for values in (v, force, saved.energy_error.reshape(-1)))
    batch = asked.batch(dt, *found)
    _require_finite(batch.energy_error, steps.h)
    return batch


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
    rest, force, modes = _static(chains)
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
