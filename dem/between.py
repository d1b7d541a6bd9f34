"""Runs whose steps do not stop at the samples, which lie on polynomials of the steps.

A step ends with positions and velocities; the forces there give the accelerations, and the
velocities the rate of the forces, so that four derivatives of every body are known at both ends.
"""

import numpy as np

from dem.chain import State
from dem.kernels.arguments import Motion, Steps
from dem.kernels.between import Between, fill_between, mend_events, save_between
from dem.kernels.ends import Bodies, fill_ends, room_for_ends
from dem.prepared import Prepared
from dem.schemes import Scheme
from dem.stability import fastest_decay
from dem.trajectory import MOST_MODES, Trajectory, equal_steps, marched, room_for, run
from dem.trajectory import trajectory as trajectory_of

WORTH = 1.1  # times as many steps, for the sake of the samples: fewer are taken as they are
MOST_ENDS = 4  # of steps a sample: beyond, stopping there adds little
FOLLOWED = 2.5  # of a mode's phase, that a polynomial follows in a step


def run_between(
    prepared: Prepared, state: State, duration: float, dt: float, scheme: Scheme, n_save: int
) -> Trajectory:
    """Trajectory of a prepared chain at n_save + 1 equal times, by steps up to dt that need not end
    there. They do where few more steps are taken for it, and where forces are not smooth while a
    contact is closed; see `march`."""
    bound = equal_steps(duration, dt, n_save)
    n = int(np.ceil(duration / min(dt, _followed(prepared, state)) * (1 - 1e-9)))
    few = bound.n_save * bound.stride <= WORTH * n or n > MOST_ENDS * n_save
    if few or prepared.static.q.size > MOST_MODES or not _smooth(prepared):
        return run(prepared, state, duration, dt, scheme, n_save)
    found = marched(prepared, state, Steps(duration / n, n, 1), scheme, speeds=True)
    return _sampled(prepared, found, duration, n_save)


def _smooth(prepared):
    """Whether forces and their rates follow from positions and velocities without a jump."""
    chain, wall = prepared.chain, prepared.wall
    gives = wall is not None and (wall.residual_compliance != 0.0 or wall.mobility != 0.0)
    damped = prepared.damping is not None
    smooth = not damped or (chain.dissipation == "hunt-crossley" and not gives)
    return smooth and not (chain.slides or chain.yield_overlap is not None)


def _followed(prepared, state):
    """[s] that polynomials follow of what the march moves exactly: modes, leaf springs, dampers."""
    chain, wall = prepared.chain, prepared.wall
    rates = np.sqrt(chain.springs[0] / chain.mass)
    if wall is not None:
        rates = np.append(rates, wall.omega)
    fastest = max(rates.max() / FOLLOWED, fastest_decay(prepared, state.v))
    return 1.0 / fastest if fastest > 0.0 else np.inf


def _sampled(prepared, found, duration, n_save):
    """A march saved at the end of every step, at n_save + 1 equal times."""
    ends, parts, h = found.saved, found.parts, found.steps.h
    bodies, known = _bodies(prepared, parts), room_for_ends(ends)
    fill_ends(ends, bodies, h, known)
    k, n = n_save + 1, parts.mass.size
    (x, v), (q, p), (slow, slopes) = (
        np.empty((2, k, part.x.shape[1])) for part in (known.spheres, known.modes, known.slow)
    )
    fill_between(known.spheres, h, x, v)
    fill_between(known.modes, h, q, p)
    fill_between(known.slow, h, slow, slopes)
    rows = Between(x, v, q, p, slow)
    mend_events(known.gaps, h, bodies, rows)
    saved = room_for(k, prepared)
    final = found.final._replace(q=found.final.q.copy(), p=found.final.p.copy())
    shown = Motion(np.empty(n), np.empty(n), np.zeros(n + 1), np.empty(4), np.zeros(3))
    save_between(h, shown, parts, rows, saved)
    sampled = trajectory_of(found._replace(final=final), saved, duration)
    worst = float(np.abs(ends.energy[:, 10] - ends.energy[0, 10]).max()) / sampled.energy_scale
    return sampled._replace(energy_error=worst)


def _bodies(prepared, parts):
    chain, wall, static, load, damping = prepared
    none, n = np.zeros(0), chain.mass.size
    modal = (none, none, none)
    if static.q.size:
        modal = (wall.phi, wall.omega**2, 2.0 * wall.zeta * wall.omega)
    return Bodies(
        parts.inverse_mass, chain.A, np.zeros(chain.A.size) if damping is None else damping.gamma,
        np.zeros(n) if load is None else load, chain.springs[0], static.x, *modal, static.q,
        0.0 if wall is None else float(wall.residual_compliance),
        0.0 if wall is None else float(wall.mobility),
        float(static.force[-1]) if static.force.size else 0.0,
    )  # fmt: skip
