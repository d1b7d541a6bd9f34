"""Runs whose steps do not end at the samples: these are taken from polynomials over the steps.

A step ends with positions and velocities; the forces there give the accelerations, and the
velocities the rate of the forces, so that four derivatives of every body are known at both ends.
"""

import numpy as np

from beadwave.dem.chain import State
from beadwave.dem.kernels.arguments import ChainArrays, Motion, Steps
from beadwave.dem.kernels.between import InterpolatedStates, save_between
from beadwave.dem.kernels.ends import ChainAndWall, empty_step_ends
from beadwave.dem.prepared import PreparedChain
from beadwave.dem.schemes import Scheme
from beadwave.dem.stability import fastest_decay
from beadwave.dem.trajectory import MOST_MODES, Trajectory, equal_steps, marched, room_for, run
from beadwave.dem.trajectory import trajectory as trajectory_of


def run_between(
    prepared: PreparedChain, state: State, duration: float, dt: float, scheme: Scheme, n_save: int
) -> Trajectory:
    """Trajectory of a prepared chain at n_save + 1 equally spaced times, by steps up to dt [s].

    Steps end at these times only where that takes few more of them, and where forces are not smooth
    while a contact is closed. See `march`.
    """
    chain, wall = prepared.chain, prepared.wall

    # steps that polynomials can follow: modes and leaf springs, which the march moves exactly, by
    # 2.5 of their phase, and dampers
    rates = [0.0] if wall is None else [0.0, *wall.omega]
    if chain.leaf_stiffness is not None:
        rates.append(float(np.sqrt((chain.springs[0] / chain.mass).max())))
    fastest = max(max(rates) / 2.5, fastest_decay(prepared, state.v))
    longest = 1.0 / fastest if fastest > 0.0 else np.inf
    n_steps = int(np.ceil(duration / min(dt, longest) * (1 - 1e-9)))

    # steps that end at the samples are as good where it takes 1.1 times as many, or more than four
    # a sample
    bound = equal_steps(duration, dt, n_save)
    few = bound.n_save * bound.stride <= 1.1 * n_steps or n_steps > 4 * n_save

    # forces and their rates have to follow from positions and velocities without a jump
    gives = wall is not None and (wall.residual_compliance != 0.0 or wall.mobility != 0.0)
    damped = prepared.damping is not None
    smooth = not damped or not (chain.jumps or gives)
    smooth = smooth and not (chain.slides or chain.yield_overlap is not None)
    smooth = smooth and chain.elastic.shape is None  # the polynomials know of Hertz contacts
    if few or prepared.static.q.size > MOST_MODES or not smooth:
        return run(prepared, state, duration, dt, scheme, n_save)

    # march, with everything saved at the end of every step, then sample; the modes of the march
    # serve as room for those of a sample
    march = marched(prepared, state, Steps(duration / n_steps, n_steps, 1), scheme, speeds=True)
    k, n, n_modes = n_save + 1, chain.mass.size, prepared.static.q.size
    samples = InterpolatedStates(
        *np.empty((2, k, n)), *np.empty((2, k, n_modes)), *np.empty((2, k, 4))
    )  # fmt: skip
    saved = room_for(k, prepared)
    final = march.final._replace(q=march.final.q.copy(), p=march.final.p.copy())
    snapshot = Motion(np.empty(n), np.empty(n), np.zeros(n + 1), np.empty(4), np.zeros(3))
    save_between(
        march.steps.h, march.saved, chain_and_wall(prepared, march.arrays),
        empty_step_ends(march.saved), samples, snapshot, march.arrays, saved,
    )  # fmt: skip
    sampled = trajectory_of(march._replace(final=final), saved, duration)

    # the energy error is that of the march, not of the polynomials
    total = march.saved.energy[:, 10]
    return sampled._replace(
        energy_error=float(np.abs(total - total[0]).max()) / sampled.energy_scale
    )


def chain_and_wall(prepared: PreparedChain, arrays: ChainArrays) -> ChainAndWall:
    """Arrays from which accelerations and their rates follow, with shapes and units as at
    `ChainAndWall`; 0 for parts that the chain lacks."""
    chain, wall, static, load, damping = prepared
    modal = (np.zeros(0),) * 3
    if static.q.size:
        modal = (wall.phi, wall.omega**2, 2.0 * wall.zeta * wall.omega)
    return ChainAndWall(
        arrays.inverse_mass, chain.A, np.zeros(chain.A.size) if damping is None else damping.gamma,
        np.zeros(chain.mass.size) if load is None else load, chain.springs[0], static.x, *modal,
        static.q,
        0.0 if wall is None else float(wall.residual_compliance),
        0.0 if wall is None else float(wall.mobility),
        float(static.force[-1]) if static.force.size else 0.0,
    )  # fmt: skip
