"""The march of a chain and its wall with a fixed step, and its trajectory."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beadwave.dem.chain import Chain, State, validate
from beadwave.dem.checks import InvalidChain, positive, saves, vector
from beadwave.dem.kernels import oscillators
from beadwave.dem.kernels.arguments import (
    Array,
    ChainArrays,
    LeafSprings,
    Motion,
    Plastic,
    SavedStates,
    Steps,
    WallModes,
)
from beadwave.dem.kernels.explicit import march as march_explicit
from beadwave.dem.kernels.implicit import march_implicit, workspace
from beadwave.dem.kernels.laws import plastic_loss
from beadwave.dem.prepared import PreparedChain, prepare
from beadwave.dem.schemes import Scheme
from beadwave.dem.stability import UnstableStep, marching_scheme, refuse_step
from beadwave.dem.walls import Wall

MOST_MODES = 500  # of a wall whose modal coordinates are saved: 6 MB at the usual 3000 instants


class ArrayErrors(NamedTuple):
    """Errors by the time step, largest over all saves, of each column of a trajectory."""

    x: Array  # (n,) [m]
    v: Array  # (n,) [m/s]
    contact_force: Array  # (n_contacts,) [N]


class Trajectory(NamedTuple):
    """Saved states, forces and the energy ledger; k saves of n spheres.

    energy_error is over the ends of all steps, over the saves alone where steps stop at these.
    """

    t: Array  # (k,) [s]
    x: Array  # (k, n) [m]
    v: Array  # (k, n) [m/s]
    contact_force: Array  # (k, n_contacts) [N], dampers included
    wall_x: Array  # (k,) [m] modes and dashpot, without the residual spring
    wall_v: Array  # (k,) [m/s]
    wall_q: NDArray[np.float32]  # (k, n_modes) [kg^1/2 m] of a wall of up to MOST_MODES, else empty
    energy_kinetic: Array  # (k,) [J] of the spheres
    energy_contact: Array  # (k,) [J] elastic
    energy_leaf: Array  # (k,) [J] of the leaf springs
    energy_wall: Array  # (k,) [J] kinetic and strain energy of the modes
    energy_residual: Array  # (k,) [J] of the residual spring
    dissipated_contact: Array  # (k,) [J] by dampers and yield
    dissipated_wall: Array  # (k,) [J] by the modes' damping and a dashpot
    dissipated_guides: Array  # (k,) [J] by friction
    work_preload: Array  # (k,) [J]
    work_gravity: Array  # (k,) [J]
    energy_total: Array  # (k,) [J] constant if exact
    dt: float  # [s]
    n_steps: int
    scheme: str
    energy_error: float  # largest |energy_total - start| / kinetic energy there
    error_estimate: float | None  # relative velocity error; None for a step that was given
    final: State
    errors: ArrayErrors | None = None  # None for a step that was given

    @property
    def energy_scale(self) -> float:
        """Energy [J] that errors of the energy are relative to."""
        return float(self.energy_kinetic[0] or np.abs(self.energy_total).max() or 1.0)

    @property
    def ledger(self) -> tuple[np.ndarray, ...]:
        """The ten parts (k,) [J] that make up energy_total, the works with the opposite sign."""
        return (
            self.energy_kinetic,
            self.energy_contact,
            self.energy_leaf,
            self.energy_wall,
            self.energy_residual,
            self.dissipated_contact,
            self.dissipated_wall,
            self.dissipated_guides,
            self.work_preload,
            self.work_gravity,
        )


def require_march(
    chain: Chain, wall: Wall | None, v0: ArrayLike, *, dt: float | None = None
) -> None:
    """Raise what `march` from velocities v0 (n,) [m/s] would before its first step: InvalidChain,
    NoEquilibrium, and of a step dt [s] UnstableStep."""
    validate(chain, wall, v0)
    prepared = prepare(chain, wall)
    if dt is not None:
        refuse_step(prepared, v0, dt, marching_scheme(prepared, v0, dt))


def march(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    *,
    duration: float,
    dt: float,
    scheme: str | None = None,
    n_save: int | None = None,
    state: State | None = None,
) -> Trajectory:
    """Trajectory from the static state with velocities v0 (n,) [m/s], at n_save + 1 equal times
    from 0 to `duration` [s]; without n_save about every step is saved, up to 1000.

    The step taken is the largest that divides the saves' spacing and is not above dt [s]. `scheme`
    is a name of `SCHEMES`, without it the one that measures best. `state` continues an earlier
    march instead (v0 is then ignored).

    Raises InvalidChain; NoEquilibrium; UnstableStep before the first step for one too long, after
    the march where a state is not finite or the energy ledger is off by more than the energy there
    is.
    """
    validate(chain, wall, v0 if state is None else state.v)
    if state is not None:
        n, n_modes = chain.mass.size, 0 if wall is None else wall.omega.size
        for name, size in {"x": n, "q": n_modes, "p": n_modes, "wall": 4}.items():
            vector(f"{name} of the state", getattr(state, name), size)
    positive("duration", duration, " s")
    positive("dt", dt, " s")
    if duration > 1e12 * dt:  # months of computing
        raise InvalidChain(f"dt = {dt:g} s makes {duration / dt:.1e} steps; take a longer one")
    if n_save is not None:
        saves(n_save, chain.mass.size)
    prepared = prepare(chain, wall)
    state = start(prepared, v0) if state is None else state
    method = marching_scheme(prepared, state.v, dt, scheme)
    refuse_step(prepared, state.v, dt, method)
    if n_save is None:
        n_save = min(1000, int(np.ceil(duration / dt * (1 - 1e-9))))
    trajectory = run(prepared, state, duration, dt, method, n_save)

    # a ledger is broken that is off by more than the energy at the start and by more than any of
    # its entries: of tiny motion in a pressed chain the first alone says nothing
    if not trajectory.energy_error <= 1.0:
        largest = max(entry.max() for entry in trajectory.ledger)
        if not np.ptp(trajectory.energy_total) <= largest:
            raise UnstableStep(
                f"with dt = {trajectory.dt:.3g} s the energy ledger is off by "
                f"{trajectory.energy_error:.3g} of the energy at the start; take a smaller dt"
            )
    return trajectory


def start(prepared: PreparedChain, v0: ArrayLike) -> State:
    """State at rest in equilibrium, with the velocities v0 (n,) [m/s]; modes and dashpot rest."""
    static = prepared.static
    n_modes = static.q.size
    return State(static.x, np.array(v0, float), np.zeros(n_modes), np.zeros(n_modes), np.zeros(4))


def run(
    prepared: PreparedChain, state: State, duration: float, dt: float, scheme: Scheme, n_save: int
) -> Trajectory:
    """Trajectory of a prepared chain for `duration` [s] by steps up to dt [s]; see `march`, which
    looks at the numbers before."""
    march = marched(prepared, state, equal_steps(duration, dt, n_save), scheme)
    return trajectory(march, march.saved, duration)


class MarchResult(NamedTuple):
    """The result of a march by equal steps."""

    steps: Steps
    scheme: Scheme
    arrays: ChainArrays
    saved: SavedStates
    final: State


def marched(
    prepared: PreparedChain, state: State, steps: Steps, scheme: Scheme, *, speeds: bool = False
) -> MarchResult:
    """March a prepared chain, with the speeds of the wall's modes if asked for; raises
    UnstableStep."""
    chain = prepared.chain
    n = chain.mass.size
    arrays = chain_arrays(prepared, state, scheme, steps.h)
    motion = Motion(state.x.copy(), state.v.copy(), np.zeros(n + 1), state.wall.copy(), np.zeros(3))
    out = room_for(steps.n_save + 1, prepared, speeds=speeds)
    snapshot = motion._replace(f=np.zeros(n + 1))
    if scheme.kind == "implicit":
        work = workspace(n, chain.A.size)
        count = march_implicit(motion, snapshot, arrays, *work, scheme.b, steps, out)
    else:
        step_start = motion._replace(x=np.empty(n), v=np.empty(n), wall=np.empty(4))
        fractions = (scheme.a, scheme.b)
        correction = scheme.correction if arrays.shape is None else None  # of Hertz' power 3/2
        count = march_explicit(
            motion, step_start, snapshot, arrays, fractions, correction, steps, out
        )
    if count < steps.n_save:
        raise UnstableStep(
            f"the state is not finite at t = {count * steps.stride * steps.h:.4g} s with "
            f"dt = {steps.h:.4g} s; take a smaller dt, or a larger (less negative) residual "
            "compliance of the wall"
        )
    modes, plastic = arrays.modes, arrays.plastic
    q, p = (np.zeros(0), np.zeros(0)) if modes is None else (modes.q, modes.p)
    deepest = None if plastic is None else plastic.top
    final = State(motion.x, motion.v, q, p, motion.wall, deepest)
    return MarchResult(steps, scheme, arrays, out, final)


def equal_steps(duration: float, dt: float, n_save: int) -> Steps:
    """The longest steps not above dt [s] that divide the spacing duration / n_save of the saves. A
    dt that is above such a step by rounding alone counts as that step."""
    stride = max(1, int(np.ceil(duration / (n_save * dt) * (1 - 1e-9))))
    return Steps(duration / (n_save * stride), n_save, stride)


def trajectory(march: MarchResult, out: SavedStates, duration: float) -> Trajectory:
    """The Trajectory of what a march saved at equally spaced times."""
    total, steps = out.energy[:, 10], march.steps
    scale = out.energy[0, 0] or np.abs(total).max() or 1.0
    n_save = total.size - 1
    t = np.arange(n_save + 1) * (duration / n_save)
    t[-1] = duration
    return Trajectory(
        t,
        out.x,
        out.v,
        out.force,
        *out.wall.T,
        out.modes.astype(np.float32),
        *out.energy[:, :10].T,
        total,
        steps.h,
        steps.n_save * steps.stride,
        march.scheme.name,
        energy_error=float(np.abs(total - total[0]).max() / scale),
        error_estimate=None,
        final=march.final,
    )


def room_for(k: int, prepared: PreparedChain, *, speeds: bool = False) -> SavedStates:
    """Room for k saves; the modes of walls of up to MOST_MODES."""
    n, n_contacts, n_modes = prepared.chain.mass.size, prepared.chain.A.size, prepared.static.q.size
    n_modes = n_modes if n_modes <= MOST_MODES else 0
    widths = (n, n, n_contacts, 2, 11, n_modes, n_modes if speeds else 0)
    return SavedStates(*(np.empty((k, width)) for width in widths))


def chain_arrays(prepared: PreparedChain, state: State, scheme: Scheme, h: float) -> ChainArrays:
    """Arrays that a march by steps of h [s] reads; those of modes and plastic contacts it changes.

    Modes and leaf springs move on exactly over each of the scheme's fractions of the step: the
    drifts of explicit schemes, the parts of a step of implicit ones.
    """
    chain, wall, static, load, damping = prepared
    implicit = scheme.kind == "implicit"
    spans = h * (scheme.b if implicit else scheme.a)

    # each sphere on its leaf spring is an undamped oscillator about its static position
    leaf = None
    if chain.leaf_stiffness is not None and np.any(chain.leaf_stiffness):
        omega = np.sqrt(chain.leaf_stiffness / chain.mass)
        undamped = np.zeros_like(omega)
        leaf = LeafSprings(
            *chain.springs,
            static.x,
            oscillators.propagators(spans, omega, undamped)[:, :3].copy(),
            _step_responses(omega, undamped, spans) if implicit else None,
        )

    # modes move about their static displacements, so that a chain at rest stays so to rounding
    modes = None
    if state.q.size:
        arrays = (state.q.copy(), state.p.copy(), wall.phi, wall.omega, static.q)
        modes = WallModes(
            *(np.ascontiguousarray(values, float) for values in arrays),
            oscillators.propagators(spans, wall.omega, wall.zeta),
            _step_responses(wall.omega, wall.zeta, spans) if implicit else None,
            float(wall.phi @ wall.phi),
            float(static.force[-1]),
        )

    # contacts of a march that is continued are as flat as they were pressed before
    plastic = None
    if chain.yield_overlap is not None:
        limit = np.asarray(chain.yield_overlap, float)
        plastic = Plastic(limit, limit.copy(), np.array(chain.A, float), np.zeros_like(limit))
        for i, top in enumerate([] if state.deepest is None else state.deepest):
            plastic.top[i] = top
            _, plastic.coefficient[i], plastic.crater[i] = plastic_loss(limit[i], top, chain.A[i])

    # absent parts are None, and compiled out; a bare chain takes the shortest kernel
    friction = np.asarray(chain.friction, float) if chain.slides else None
    bare = all(array is None for array in (load, leaf, damping, plastic, friction))
    return ChainArrays(
        chain.mass, 1.0 / chain.mass, chain.A, chain.elastic.shape,
        preload=float(chain.preload),
        weight=chain.gravity * chain.mass,
        friction=friction,
        offset=0.0 if wall is None else float(wall.phi @ static.q),
        load=np.zeros(chain.mass.size) if load is None else load,
        leaf=leaf,
        residual=None if wall is None else wall.residual_compliance or None,
        mobility=None if wall is None else wall.mobility or None,
        modes=modes,
        damping=damping,
        plastic=plastic,
        bare=() if bare else None,
    )  # fmt: skip


def _step_responses(omega, zeta, spans):
    """(len(spans), k) [m] of oscillators of unit mass under unit force over each span."""
    return np.array([oscillators.step_response(omega, zeta, t) for t in spans])
