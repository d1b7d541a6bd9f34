"""Many bare chains at once: equal in length and wall modes, different in everything else.

Chains lie side by side in the lanes of vector registers and in blocks on the threads. Bare means
Hertz contacts, no dissipation, yield, leaf springs, preload, residual spring or dashpot.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from dem import kernels
from dem.chain import InvalidChain, Wall, validate
from dem.schemes import SCHEMES
from dem.stability import UnstableStep
from dem.step_control import march_to_error
from dem.trajectory import oscillator_turn

LANES = kernels.LANES


class Batch(NamedTuple):
    """What many marches leave: n_chains chains, k saves."""

    t: np.ndarray  # (k,)
    v: np.ndarray  # (n_chains, k, n_observed)
    wall_force: np.ndarray  # (n_chains, k), 0 for free chains
    energy_error: np.ndarray  # (n_chains,) largest change over the energy at the start
    dt: float
    n_steps: int
    scheme: str
    error_estimate: float | None  # relative velocity error of the sampled chains


def march_batch(
    chain,
    wall,
    v0,
    *,
    duration,
    dt=None,
    error=None,
    observed=None,
    scheme="rkn6",
    n_save=100,
    threads=None,
    mend=True,
):
    """Batch of chains that start just touching with velocities v0.

    Fields of chain and wall and v0 have a leading axis n_chains, or lack it and are shared. Give
    dt, or the velocity error relative to the largest initial speed: the step is then found on the
    stiffest chain and the estimate taken from up to 16 chains. Raises InvalidChain, UnstableStep.
    """
    if (dt is None) == (error is None):
        raise InvalidChain("give either dt or error to say how finely to march")
    members = _Members(chain, wall, v0)
    if dt is None:
        return _to_error(members, duration, error, observed, scheme, n_save, threads, mend)
    return _march(members, duration, dt, observed, scheme, n_save, threads, mend)


class _Members:
    """Chains of a batch, every array with its leading axis."""

    def __init__(self, chain, wall, v0):
        _refuse_parts(chain, wall)
        wall = Wall(*np.zeros((3, 0))) if wall is None else wall
        arrays = [chain.mass, chain.A, v0, wall.omega, wall.zeta, wall.phi]
        arrays = [np.asarray(values, float) for values in arrays]
        count = max(values.shape[0] if values.ndim == 2 else 1 for values in arrays)
        wide = [np.broadcast_to(values, (count, values.shape[-1])) for values in arrays]
        self.mass, self.A, self.v0, self.omega, self.zeta, self.phi = wide
        self.chain, self.free = chain, self.A.shape[1] < self.mass.shape[1]
        self.count = count
        for i in {0, count - 1}:
            validate(*self[i])
        if not all(np.isfinite(values).all() for values in wide) or (self.A <= 0).any():
            raise InvalidChain("a chain of the batch has a value that is not finite or A <= 0")

    def __getitem__(self, i):
        radius = np.broadcast_to(self.chain.radius, self.mass.shape)[i]
        one = self.chain._replace(mass=self.mass[i], radius=radius, A=self.A[i])
        wall = None if self.free else Wall(self.omega[i], self.zeta[i], self.phi[i])
        return one, wall, self.v0[i]

    def take(self, rows):
        """The members of these rows."""
        part = object.__new__(_Members)
        part.chain, part.free, part.count = self.chain, self.free, len(rows)
        for name in ("mass", "A", "v0", "omega", "zeta", "phi"):
            setattr(part, name, getattr(self, name)[rows])
        return part


def _refuse_parts(chain, wall):
    parts = {
        "dissipation": chain.dissipation != "none",
        "plastic contacts": chain.yield_overlap is not None,
        "leaf springs": np.any(chain.leaf_stiffness),
        "preload": chain.preload != 0.0,
        "a residual compliance": wall is not None and np.any(wall.residual_compliance),
        "a dashpot wall": wall is not None and np.any(wall.mobility),
    }
    found = [name for name, present in parts.items() if present]
    if found:
        raise InvalidChain(f"a batch takes bare chains, found {found[0]}; march these one by one")


def _to_error(members, duration, error, observed, scheme, n_save, threads, mend):
    stiffest = int(members.A.max(axis=1).argmax())
    chain, wall, v0 = members[stiffest]
    dt = march_to_error(
        chain, wall, v0, duration=duration, error=error, observed=observed, scheme=scheme,
        n_save=n_save, energy_error=np.inf,
    ).trajectory.dt  # fmt: skip
    rows = np.unique(np.linspace(0, members.count - 1, 16).astype(int))
    sample = members.take(rows)
    speed = np.abs(sample.v0).max(axis=1)[:, None, None]
    while True:
        coarse = _march(sample, duration, dt, observed, scheme, n_save, threads, mend)
        fine = _march(sample, duration, coarse.dt / 2, observed, scheme, n_save, threads, mend)
        # the coarse step is the one used: its error is the whole difference
        estimate = float((np.abs(fine.v - coarse.v) / speed).max()) * 1.25
        if estimate <= error:
            break
        dt = coarse.dt / 1.5
    return _march(members, duration, dt, observed, scheme, n_save, threads, mend)._replace(
        error_estimate=estimate
    )


def _march(members, duration, dt, observed, scheme, n_save, threads, mend):
    method = SCHEMES[scheme]
    stride = max(1, int(np.ceil(duration / (n_save * dt) * (1 - 1e-9))))
    h = duration / (n_save * stride)
    n = members.mass.shape[1]
    observed = np.arange(n) if observed is None else np.asarray(observed)
    A = members.A
    if members.free:
        A = np.concatenate([A, np.zeros((members.count, 1))], axis=1)
    packed = [_packed(values) for values in (members.v0, members.mass, A)]
    phi, omega, zeta = (_packed(values) for values in (members.phi, members.omega, members.zeta))
    blocks, k = phi.shape[:2]
    turn = np.zeros((blocks, method.a.size, 4, k * LANES))
    for i, drift in enumerate(h * method.a if k else []):
        turns = oscillator_turn(omega, zeta, drift)
        turn[:, i] = turns.reshape(4, blocks, -1).transpose(1, 0, 2)
    vs = np.empty((blocks, n_save + 1, observed.size, LANES))
    walls = np.empty((blocks, n_save + 1, LANES))
    errors = np.zeros((blocks, LANES))

    def work(part):
        kernels.march_lanes(
            *(values[part] for values in packed), phi[part], omega[part], turn[part], method.a,
            method.b, h, n_save, stride, observed, method.mend if mend else None,
            vs[part], walls[part], errors[part],
        )  # fmt: skip

    _share(work, blocks, threads or os.cpu_count() or 1)
    errors = errors.reshape(-1)[: members.count]
    if not np.isfinite(errors).all():
        raise UnstableStep(
            f"chain {int((~np.isfinite(errors)).argmax())} of the batch is not finite with "
            f"dt = {h:.3g} s; take a smaller dt"
        )
    return Batch(
        np.linspace(0.0, duration, n_save + 1),
        vs.transpose(0, 3, 1, 2).reshape(blocks * LANES, n_save + 1, -1)[: members.count],
        walls.transpose(0, 2, 1).reshape(blocks * LANES, -1)[: members.count],
        errors,
        h,
        n_save * stride,
        scheme,
        None,
    )


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
