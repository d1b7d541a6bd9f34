"""The wall's modes under an impulse, a shift or a drift; a wall without modes stays.

impulse I:  p <- p + phi I,  v_w <- v_w + (phi phi) I,  work I (v_w + phi phi I / 2)
drift:      (q, p) <- E (q, p), exact for damped oscillators
"""

from beadwave.dem.kernels.arguments import WORK, Array, U, V, WallModes
from beadwave.dem.kernels.compiled import fastmath_inline, ieee


@fastmath_inline
def push_wall(impulse: float, square: float, wall: Array) -> None:
    """Work [J] of an impulse [N s] on the modes, and the velocity that it leaves the wall (4,)
    with; `square` [1/kg] is phi phi. The modes themselves get the impulse elsewhere."""
    wall[WORK] += impulse * (wall[V] + 0.5 * square * impulse)
    wall[V] += square * impulse


@fastmath_inline
def push_modes(impulse: float, wall: Array, modes: WallModes | None) -> None:
    """Impulse [N s] at the wall (4,) on every mode: p_j += phi_j I."""
    if modes is not None:
        for j in range(modes.p.size):
            modes.p[j] += modes.phi[j] * impulse
        push_wall(impulse, modes.square, wall)


@ieee
def shift_modes(shift: float, wall: Array, modes: WallModes | None) -> None:
    """Displacement of every mode by a shift times mass [kg m] at the wall (4,): q_j += phi_j S."""
    if modes is not None:
        wall[U] += modes.square * shift
        for j in range(modes.q.size):
            modes.q[j] += modes.phi[j] * shift


@fastmath_inline
def drift_modes(k: int, impulse: float, wall: Array, modes: WallModes | None) -> None:
    """Exact free motion of the damped modes by the k-th drift after an impulse [N s] at the wall
    (4,), whose displacement and velocity are summed anew from the modes: the rounding of
    `push_wall` does not pile up."""
    if modes is None:
        return
    q, p, phi = modes.q, modes.p, modes.phi
    E = modes.propagator
    qq, qp, pq, pp = E[k, 0], E[k, 1], E[k, 2], E[k, 3]
    u = 0.0
    w = 0.0
    for j in range(q.size):
        r = phi[j]
        q_old = q[j]
        speed = p[j] + r * impulse
        q_new = qq[j] * q_old + qp[j] * speed
        speed = pq[j] * q_old + pp[j] * speed
        q[j] = q_new
        p[j] = speed
        u += r * q_new
        w += r * speed
    wall[U] = u
    wall[V] = w


@fastmath_inline
def modal_energy(modes: WallModes | None) -> tuple[float, float]:
    """Energy [J] of the modes about the static state, and in all, the static deflection included;
    0 without modes."""
    swing = 0.0
    absolute = 0.0
    if modes is not None:
        for j in range(modes.q.size):
            kinetic = 0.5 * modes.p[j] ** 2
            stiffness = 0.5 * modes.omega[j] ** 2
            swing += kinetic + stiffness * modes.q[j] ** 2
            absolute += kinetic + stiffness * (modes.q[j] + modes.static[j]) ** 2
    return swing, absolute
