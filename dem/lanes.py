"""Chains of a batch in the lanes of vector registers: packed into blocks, marched by threads.

A block holds LANES chains, one in each lane of a register, so that one instruction advances the
same sphere of all of them; the last block is filled up with the batch's last chain.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from beadwave.dem.chains import Chains
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.lanes import (
    LANES,
    Blocks,
    Dampers,
    LaneSteps,
    RestingForces,
    SavedLanes,
    WallSprings,
    march_lanes,
)
from beadwave.dem.kernels.laws import DAMPING_LAWS, ELASTIC_LAWS
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.prepared import prepare
from beadwave.dem.schemes import Scheme
from beadwave.dem.stability import refuse_step


class LaneRuns(NamedTuple):
    """Chains marched side by side, at k samples."""

    v: Array  # (n_chains, k, n_observed) [m/s]
    wall_force: Array  # (n_chains, k) [N]
    energy_error: Array  # (n_chains,) largest change over the energy at the start


def march_side_by_side(
    chains: Chains, method: Scheme, steps: LaneSteps, observed: Array, threads: int
) -> LaneRuns:
    """Chains marched by equal steps, the same for all, in a number of threads; observed
    (n_observed,) are indices of spheres.

    Raises UnstableStep where the step is too long for the damping of a chain; what is unstable in
    other ways leaves values that are not finite.
    """
    if chains.damped:
        chain, wall, v0 = chains[chains.most_damped]
        refuse_step(prepare(chain, wall), v0, steps.h, method)
    blocks = blocks_of(chains, steps.h * method.a)
    n, k = len(blocks.v0), steps.n_save + 1
    saved = SavedLanes(
        np.empty((n, k, observed.size, LANES)),
        np.empty((n, k, LANES)),
        np.zeros((n, LANES)),
    )

    # what a contact that opens or closes in a step adds is known of Hertz' law
    correction = method.correction if chains.elastic.shape is None else None

    # four blocks at a time are dealt to the threads; shapes of forces are those of one block
    law, shape = chains.elastic, chains.elastic.shape
    idle = 0, int(chains.free)  # the last sphere of a free chain has a contact with A = 0
    parameters = [] if shape is None else [
        _packed(np.pad(values, ((0, 0), idle), constant_values=parameter.low))
        for values, parameter in zip(
            shape.parameters, ELASTIC_LAWS[law.name].parameters, strict=True
        )
    ]  # fmt: skip
    size = 4 if shape is None else 1
    pieces = [slice(i, i + size) for i in range(0, n, size)]

    def march(piece):
        """March the blocks of a slice into `saved`."""
        block = _sliced(blocks, piece)
        if parameters:
            of_block = np.stack([values[piece].ravel() for values in parameters])
            block = block._replace(shape=shape._replace(parameters=of_block))
        elif shape is not None:
            block = block._replace(shape=shape)
        march_lanes(
            block, method.a, method.b, correction, steps, observed, _sliced(saved, piece)
        )  # fmt: skip

    if threads == 1 or len(pieces) == 1:
        for piece in pieces:
            march(piece)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(march, pieces))

    # from lanes to chains, one after the other in memory; the chains that fill up the last block go
    count = chains.count
    v = saved.v.transpose(0, 3, 1, 2).reshape(n * LANES, k, -1)
    wall_force = saved.wall_force.transpose(0, 2, 1).reshape(n * LANES, k)
    return LaneRuns(
        np.ascontiguousarray(v[:count]),
        np.ascontiguousarray(wall_force[:count]),
        saved.energy_error.ravel()[:count],
    )


def blocks_of(chains: Chains, drifts: Array) -> Blocks:
    """Blocks of a batch whose modes and leaf springs move on exactly over the drifts (n_drifts,)
    [s]. The shape of a force that is not Hertz' is left out: it is set block by block."""
    none = np.zeros((chains.count, 0))
    arrays = chains.arrays

    # spheres; a free chain has a last contact without stiffness
    A = chains.A
    if chains.free:
        A = np.concatenate([A, np.zeros((chains.count, 1))], axis=1)
    v0, mass = _packed(chains.v0), _packed(chains.mass)

    # modes of the wall, and the exact swing on leaf springs
    phi, omega, zeta = (_packed(arrays.get(name, none)) for name in ("phi", "omega", "zeta"))
    stiffness = arrays.get("leaf_stiffness", none)
    swing = _packed(np.sqrt(stiffness / chains.mass) if stiffness.any() else none)

    # springs in series with the walls. Of a negative compliance s, sqrt(d) = -2 / (3 s A) is the
    # fold: no force answers an indentation d beyond
    springs = WallSprings(_packed(none), _packed(none))
    s = arrays.get("residual_compliance", np.zeros(0))[:, None]
    if s.any():
        e = np.minimum(s * chains.A[:, -1:], 0.0)
        fold = np.divide(-2.0, 3.0 * e, out=np.full_like(e, np.inf), where=e < 0.0)
        springs = WallSprings(_packed(s), _packed(fold))

    # dampers, with the inverse mass 1/m_i + 1/m_{i+1} of both bodies; phi phi is the wall's
    law = np.full(len(v0), DAMPING_LAWS[chains.chain.dissipation].number)
    dampers = Dampers(*np.zeros((2, len(v0), 0, LANES)), law)
    if chains.damped:
        inverse, gamma = 1.0 / chains.mass, chains.gamma
        pair = inverse + np.roll(inverse, -1, axis=1)
        if chains.free:
            gamma = np.pad(gamma, ((0, 0), (0, 1)))
        else:
            pair[:, -1] = inverse[:, -1] + np.square(chains.phi).sum(axis=1)
        dampers = Dampers(_packed(gamma), _packed(pair), law)

    return Blocks(
        v0, mass, _packed(A), None, phi, omega, _propagators(omega, zeta, drifts),
        _resting_forces(chains), _propagators(swing, np.zeros_like(swing), drifts), springs,
        dampers,
    )  # fmt: skip


def _resting_forces(chains):
    """Static states and the steady forces; empty for chains that nothing presses or holds."""
    none, preload = np.zeros((chains.count, 0)), chains.preload[:, None]
    stiffness = chains.arrays.get("leaf_stiffness", none)
    weight = chains.gravity[:, None] * chains.mass if chains.gravity.any() else none
    if not (preload.any() or stiffness.any() or weight.any()):
        return RestingForces(*map(_packed, [none] * len(RestingForces._fields)))
    rest, force, modes = chains.static
    zeros = np.zeros_like(preload)
    anchor = chains.arrays.get("leaf_anchor", np.zeros_like(chains.mass))
    leaf = (stiffness, anchor) if stiffness.any() else (none, none)
    offset = (chains.phi * modes).sum(axis=1, keepdims=True) if modes.size else zeros
    at_wall = zeros if chains.free else force[:, -1:]

    # the load balances the contact forces at rest; spheres in flight have their weight alone
    load = np.diff(np.hstack([zeros, force, zeros] if chains.free else [zeros, force]))
    falling = chains.chain.n_falling
    load[:, :falling] = weight[:, :falling] if weight.any() else 0.0
    return RestingForces(
        *map(_packed, (rest, load, offset, at_wall, modes, preload, weight, *leaf))
    )


def _propagators(omega, zeta, drifts):
    """(n_blocks, n_drifts, 4, n_modes * LANES) of `oscillator_propagator`."""
    blocks, k = omega.shape[:2]
    E = np.zeros((blocks, drifts.size, 4, k * LANES))
    for i, drift in enumerate(drifts if k else []):
        E[:, i] = (
            oscillator_propagator(omega, zeta, drift).reshape(4, blocks, -1).transpose(1, 0, 2)
        )
    return E


def _packed(values):
    """(n_blocks, m, LANES) of (n_chains, m), the last block filled up with its last chain."""
    blocks = -(-values.shape[0] // LANES)
    rows = np.minimum(np.arange(blocks * LANES), values.shape[0] - 1)
    return np.ascontiguousarray(values[rows].reshape(blocks, LANES, -1).transpose(0, 2, 1))


def _sliced(arrays, blocks):
    """A tuple of arrays, and of such tuples, with these blocks of every array alone."""
    return type(arrays)(
        *(
            None if a is None else _sliced(a, blocks) if isinstance(a, tuple) else a[blocks]
            for a in arrays
        )
    )
