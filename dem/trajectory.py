"""March a chain and its wall through time with a fixed step, and what comes out of it."""

from typing import NamedTuple

import numpy as np

from dem import kernels, oscillators
from dem.chain import LAWS, State, validate
from dem.checks import InvalidChain, positive, saves, vector
from dem.schemes import SCHEMES, default_scheme
from dem.stability import BACKWARD, UnstableStep, fastest_decay, refuse_step
from dem.statics import Equilibrium, static_state

MOST_STEPS = 1e12  # months


class Trajectory(NamedTuple):
    """Saved states, forces and the energy ledger; k saves of n spheres."""

    t: np.ndarray  # (k,)
    x: np.ndarray  # (k, n)
    v: np.ndarray  # (k, n)
    contact_force: np.ndarray  # (k, n_contacts)
    wall_x: np.ndarray  # (k,) modes and dashpot, without the residual spring
    wall_v: np.ndarray  # (k,)
    energy_kinetic: np.ndarray  # (k,) spheres
    energy_contact: np.ndarray  # (k,)
    energy_leaf: np.ndarray  # (k,)
    energy_wall: np.ndarray  # (k,) kinetic and strain energy of the modes
    energy_residual: np.ndarray  # (k,)
    dissipated_contact: np.ndarray  # (k,)
    dissipated_wall: np.ndarray  # (k,)
    work_preload: np.ndarray  # (k,)
    energy_total: np.ndarray  # (k,) constant if exact
    dt: float
    n_steps: int
    scheme: str
    energy_error: float  # largest |energy_total - start| / kinetic energy at the start
    error_estimate: float | None  # relative velocity error; None for a step that was given
    final: State


class _Prepared(NamedTuple):
    """Arrays of a chain and its wall as the kernels take them, but for the step."""

    load: np.ndarray | None
    leaf_rest: np.ndarray | None
    leaf_springs: tuple | None
    offset: float
    residual: float | None
    mobility: float | None
    wall_force: float
    static: Equilibrium
    dissipation: tuple | None


def require_march(chain, wall, v0, *, dt=None):
    """Raise what `march` would before its first step: InvalidChain, NoEquilibrium, UnstableStep."""
    validate(chain, wall, v0)
    prepared = prepare(chain, wall)
    if dt is not None:
        refuse_step(chain, wall, v0, prepared.static, dt, _scheme(chain, wall, v0, prepared, dt))


def _scheme(chain, wall, v0, prepared, dt, name=None):
    """The scheme of a name, or the one that measures best."""
    decay = fastest_decay(chain, wall, v0, prepared.static)
    name = name or default_scheme(chain, wall, stiffly_damped=dt * decay > BACKWARD)
    if name not in SCHEMES:
        raise InvalidChain(f"scheme {name!r} is unknown; take one of {', '.join(SCHEMES)}")
    return SCHEMES[name]


def march(chain, wall, v0, *, duration, dt, scheme=None, n_save=None, state=None, mend=True):
    """Trajectory from the static state with velocities v0 (n,), at n_save + 1 equal times.

    The step taken is the largest that divides the saves' spacing and is not above dt. `state`
    continues an earlier march instead (v0 is then ignored). Raises InvalidChain, NoEquilibrium,
    UnstableStep.
    """
    validate(chain, wall, v0 if state is None else state.v)
    if state is not None:
        _validate_state(chain, wall, state)
    positive("duration", duration, " s")
    positive("dt", dt, " s")
    if duration > MOST_STEPS * dt:
        raise InvalidChain(f"dt = {dt:g} s makes {duration / dt:.1e} steps; take a longer one")
    if n_save is not None:
        saves(n_save, chain.mass.size)
    prepared = prepare(chain, wall)
    state = start(chain, wall, v0, prepared.static) if state is None else state
    method = _scheme(chain, wall, state.v, prepared, dt, scheme)
    refuse_step(chain, wall, state.v, prepared.static, dt, method)
    if method.kind == "implicit" and chain.yield_overlap is not None:
        raise InvalidChain(
            f"scheme {scheme!r} takes no plastic contacts; take one that is explicit"
        )
    if n_save is None:
        n_save = min(1000, int(np.ceil(duration / dt * (1 - 1e-9))))
    trajectory = run(chain, wall, prepared, state, duration, dt, method, n_save, mend)
    if not trajectory.energy_error <= 1.0 and _ledger_is_broken(trajectory):
        raise UnstableStep(
            f"with dt = {trajectory.dt:.3g} s the energy ledger is off by "
            f"{trajectory.energy_error:.3g} of the energy at the start; take a smaller dt"
        )
    return trajectory


def _validate_state(chain, wall, state):
    n, k = chain.mass.size, 0 if wall is None else wall.omega.size
    sizes = {"x": n, "q": k, "p": k, "wall": 4}
    for name, size in sizes.items():
        vector(f"{name} of the state", getattr(state, name), size)


def _ledger_is_broken(trajectory):
    """Is the ledger off by more than any of its entries (tiny motion of a pressed chain is not)?"""
    largest = max(part.max() for part in trajectory[6:14])
    return not np.ptp(trajectory.energy_total) <= largest


def start(chain, wall, v0, static):
    """State at rest in equilibrium, with the velocities v0."""
    n_modes = static.q.size
    return State(static.x, np.array(v0, float), np.zeros(n_modes), np.zeros(n_modes), np.zeros(4))


def prepare(chain, wall):
    """Static state and the optional parts of a chain and its wall, None where absent."""
    static = static_state(chain, wall)
    if chain.yield_overlap is not None:
        _require_elastic(chain, static)
    springs = _leaf_springs(chain)
    offset = 0.0 if wall is None else float(wall.phi @ static.q)
    return _Prepared(
        load=_load(wall, static),
        leaf_rest=None if springs is None else static.x,
        leaf_springs=springs,
        offset=offset,
        residual=wall.residual_compliance or None if wall is not None else None,
        mobility=wall.mobility or None if wall is not None else None,
        wall_force=0.0 if wall is None else float(static.force[-1]),
        static=static,
        dissipation=_dissipation(chain, wall),
    )


def _load(wall, static):
    """(n,) [N] what holds every sphere against its contacts at rest; None for nothing."""
    if not static.force.any():
        return None
    force = np.concatenate([[0.0], static.force, [0.0] if wall is None else []])
    return force[1:] - force[:-1]


def _leaf_springs(chain):
    if chain.leaf_stiffness is None or not np.any(chain.leaf_stiffness):
        return None
    anchor = np.zeros_like(chain.mass) if chain.leaf_anchor is None else chain.leaf_anchor
    return chain.leaf_stiffness, anchor


def _require_elastic(chain, static):
    overlap = (static.force / chain.A) ** (2.0 / 3.0)
    i = int((overlap / chain.yield_overlap).argmax())
    if overlap[i] > chain.yield_overlap[i]:
        raise InvalidChain(
            f"contact {i + 1} is pressed {overlap[i]:.3g} m at rest, beyond its yield overlap of "
            f"{chain.yield_overlap[i]:.3g} m; lower the preload or the leaf anchors"
        )


def _dissipation(chain, wall):
    if chain.dissipation == "none" or not np.any(chain.gamma):
        return None
    inverse = 1.0 / chain.mass
    pair = inverse[:-1] + inverse[1:]
    if wall is not None:
        pair = np.append(pair, inverse[-1] + wall.phi @ wall.phi)
    return np.asarray(chain.gamma, float), LAWS[chain.dissipation], pair


def run(chain, wall, prepared, state, duration, dt, scheme, n_save, mend=True):
    """Trajectory of a validated and prepared chain; see `march`."""
    steps = equal_steps(duration, dt, n_save)
    implicit = scheme.kind == "implicit"
    drifts = steps.h * (scheme.b if implicit else scheme.a)
    modes, leaf = _modes(wall, prepared, state, drifts), _leaf(chain, prepared, drifts)
    plastic = _plastic(chain, state)
    x, v, running = state.x.copy(), state.v.copy(), state.wall.copy()
    out = _output(n_save + 1, chain.mass.size, chain.A.size)
    if implicit:
        modes, leaf = _with_reach(chain, wall, prepared, drifts, modes, leaf)
        saved = _implicitly(chain, prepared, scheme, steps, (x, v), leaf, modes, running, out)
    else:
        saved = kernels.march(
            x, v, chain.mass, chain.A, scheme.a, scheme.b, *steps, prepared.load, leaf,
            prepared.leaf_springs, float(chain.preload), prepared.offset, prepared.residual,
            prepared.mobility, modes, prepared.dissipation, plastic,
            scheme.mend if mend else None, running, out,
        )  # fmt: skip
    if saved < n_save:
        raise UnstableStep(
            f"the state is not finite at t = {saved * steps.stride * steps.h:.4g} s with "
            f"dt = {steps.h:.4g} s; take a smaller dt, or a larger (less negative) residual "
            "compliance of the wall"
        )
    q, p = (np.zeros(0), np.zeros(0)) if modes is None else modes[0][:2]
    deepest = None if plastic is None else plastic[1][kernels.TOP]
    final = State(x, v, q, p, running, deepest)
    return _trajectory(out, _instants(duration, n_save), steps, scheme, final)


class Steps(NamedTuple):
    """Equal steps between equal saves, in the order that the kernels take them."""

    h: float  # [s]
    n_save: int
    stride: int


def equal_steps(duration, dt, n_save):
    """The longest that are not above dt."""
    stride = max(1, int(np.ceil(duration / (n_save * dt) * (1 - 1e-9))))
    return Steps(duration / (n_save * stride), n_save, stride)


def _implicitly(chain, prepared, scheme, steps, moving, leaf, modes, running, out):
    load = None if prepared.load is None else np.append(prepared.load, 0.0)
    return kernels.march_implicit(
        *moving, chain.mass, chain.A, scheme.b, *steps, load, leaf, prepared.leaf_springs,
        float(chain.preload), prepared.offset, prepared.residual, prepared.mobility, modes,
        prepared.dissipation, running, out,
    )  # fmt: skip


def _with_reach(chain, wall, prepared, drifts, modes, leaf):
    """Modes and leaf springs with what a constant force moves them by."""
    if modes is not None:
        reach = [oscillators.reach(wall.omega, wall.zeta, t) for t in drifts]
        modes = (*modes, np.array(reach))
    if leaf is not None:
        omega = np.sqrt(prepared.leaf_springs[0] / chain.mass)
        reach = [oscillators.reach(omega, np.zeros_like(omega), t) for t in drifts]
        leaf = leaf[0], np.concatenate([leaf[1], np.array(reach)[:, None]], axis=1)
    return modes, leaf


def _trajectory(out, t, steps, scheme, final):
    x, v, force, wall, energies = out
    total = energies[:, 8]
    scale = energies[0, 0] or np.abs(total).max() or 1.0
    return Trajectory(
        t,
        x,
        v,
        force,
        *wall.T,
        *energies[:, :8].T,
        total,
        steps.h,
        steps.n_save * steps.stride,
        scheme.name,
        energy_error=float(np.abs(total - total[0]).max() / scale),
        error_estimate=None,
        final=final,
    )


def _instants(duration, n_save):
    t = np.arange(n_save + 1) * (duration / n_save)
    t[-1] = duration
    return t


def _modes(wall, prepared, state, drifts):
    if not state.q.size:
        return None
    own = (state.q.copy(), state.p.copy(), wall.phi, wall.omega, prepared.static.q)
    modal = tuple(np.ascontiguousarray(values, float) for values in own)
    turn = oscillators.turns(drifts, wall.omega, wall.zeta)
    return modal, turn, float(wall.phi @ wall.phi), prepared.wall_force


def _plastic(chain, state):
    if chain.yield_overlap is None:
        return None
    limit = np.asarray(chain.yield_overlap, float)
    history = np.array([limit, chain.A, np.zeros_like(limit)])
    for i, top in enumerate([] if state.deepest is None else state.deepest):
        history[kernels.TOP, i] = top
        history[1:, i] = kernels.plastic_loss(i, top, chain.A, (limit, history))[1:]
    return limit, history


def _leaf(chain, prepared, drifts):
    if prepared.leaf_springs is None:
        return None
    omega = np.sqrt(prepared.leaf_springs[0] / chain.mass)
    return prepared.leaf_rest, oscillators.turns(drifts, omega, np.zeros_like(omega))[:, :3].copy()


def _output(k, n, n_contacts):
    return (
        np.empty((k, n)),
        np.empty((k, n)),
        np.empty((k, n_contacts)),
        np.empty((k, 2)),
        np.zeros((k, 9)),
    )
