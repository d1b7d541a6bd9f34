"""March of a chain with its sensitivities to parameters: one kernel family of its own.

Spheres are marched by the classic Runge-Kutta scheme of order 4, the wall's modes by the same
scheme on top of their exact damped rotation (J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372), so
that a fast mode does not limit the step. Differentiating every stage gives the sensitivities of the
discrete solution itself, not of the equation. Derivatives by the p parameters are in capitals; p
may be 0.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array, ForceShape
from beadwave.dem.kernels.compiled import fastmath, fastmath_inline, fastmath_march
from beadwave.dem.kernels.laws import (
    elastic_indentation,
    hertz_force,
    shape_bend,
    shape_by_parameter,
    shape_force,
    shape_slope,
)

# rows of f (5 + n_parameters, n_contacts): the force of each contact, and its derivatives by the
# gap of contact and spring, by A, by the rate of the gap, by gamma, and by the parameters of the
# shape from the last row on
FORCE, BY_OVERLAP, BY_STIFFNESS, BY_RATE, BY_LOSS, BY_PARAMETERS = range(6)


class SensitivityRig(NamedTuple):
    """A chain and its wall; no part is absent, those without effect are zeros."""

    A: Array  # (n_contacts,) as `dem.elastic.ElasticLaw.A`
    shape: ForceShape | None  # of the elastic force; None: Hertz
    gamma: Array  # (n_contacts,) [s/m] of Hunt and Crossley's damping
    mass: Array  # (n,) [kg]
    load: Array  # (n,) [N] steady: weight and preload
    leaf: Array  # (n,) [N/m] stiffness
    anchor: Array  # (n,) [m]
    residual: float  # [m/N]
    offset: float  # [m] static displacement of the modes
    rest_force: float  # [N] static force at the wall
    phi: Array  # (k,) [kg^-1/2]
    propagator: Array  # (k, 2, 2) over half a step
    by_omega: Array  # (k, 2, 2) its derivatives
    by_zeta: Array  # (k, 2, 2)


class Slopes(NamedTuple):
    """Derivatives of a rig by p parameters."""

    A: Array  # (n_contacts, p)
    gamma: Array  # (n_contacts, p)
    phi: Array  # (k, p)
    omega: Array  # (k, p)
    zeta: Array  # (k, p)
    load: Array  # (n, p)
    offset: Array  # (p,)
    rest_force: Array  # (p,)
    parameters: Array | None = None  # (n_parameters, n_contacts, p) of the shape of the force


class SphereDerivatives(NamedTuple):
    """Positions and velocities (n,), and their derivatives (n, p)."""

    x: Array  # (n,) [m]
    v: Array  # (n,) [m/s]
    X: Array  # (n, p)
    V: Array  # (n, p)


class Modal(NamedTuple):
    """Displacement and velocity of the modes from the static state, and their derivatives."""

    z: Array  # (2, k)
    Z: Array  # (2, k, p)


class Stages(NamedTuple):
    """Force at the wall beyond that at rest, at the stages of a step, and its derivatives."""

    force: Array  # (4,)
    d_force: Array  # (4, p)


class DerivativeRecord(NamedTuple):
    """Velocity and acceleration of m observed spheres at every step, and their derivatives."""

    v: Array  # (n_steps + 1, m)
    a: Array
    dv: Array  # (n_steps + 1, m, p)
    da: Array


@fastmath
def contact(
    gap: float, rate: float, stiffnesses: Array, gammas: Array, shape: ForceShape | None, s: float,
    i: int, f: Array,
) -> None:  # fmt: skip
    """Force of one contact and its derivatives into column i of f (5 + n_parameters, n_contacts).

    gap [m] and rate [m/s] are those of the contact and a spring of the compliance s [m/N] in series
    together; stiffnesses A and gammas (n_contacts,). With soft = 1 / (1 + s k) and the stiffness k,
    F = A d^(3/2) (1 + gamma soft^2 rate), never below 0, where d follows the gap by soft.
    """
    A, gamma = stiffnesses[i], gammas[i]
    d = max(gap, 0.0) if s == 0.0 else elastic_indentation(i, gap, s, stiffnesses, shape)
    if shape is not None:
        shaped_contact(d, rate, (A, gamma), s, i, shape, f)
        return

    # soft falls as k grows with d, by soft^2 s k'. k' = 3/4 A / sqrt(d) is infinite at first touch,
    # but comes with the factor d^(3/2) of the force alone
    root = math.sqrt(d)
    soft = 1.0 / (1.0 + 1.5 * s * A * root)
    loss = gamma * rate * soft * soft
    share = max(1.0 + loss, 0.0)
    elastic = hertz_force(d, A)
    f[FORCE, i] = share * elastic
    f[BY_OVERLAP, i] = (share * root - loss * s * A * d * soft) * 1.5 * A * soft
    by_stiffness = share - 3.0 * loss * s * A * (root - 0.5 * s * A * d * soft)
    f[BY_STIFFNESS, i] = by_stiffness * d * root * soft
    f[BY_RATE, i] = gamma * elastic * soft * soft if share > 0.0 else 0.0
    f[BY_LOSS, i] = rate * elastic * soft * soft if share > 0.0 else 0.0


@fastmath
def shaped_contact(
    d: float, rate: float, factors: tuple[float, float], s: float, i: int, shape: ForceShape,
    f: Array,
) -> None:  # fmt: skip
    """`contact` of a force A phi(d) at the overlap d [m] with the stiffness k = A phi' and its
    derivative k' = A phi'' by d: the overlap follows the gap by soft = 1 / (1 + s k), the damper
    acts by gamma soft^2. `factors` are A and gamma; into column i of f
    (5 + n_parameters, n_contacts)."""
    A, gamma = factors
    phi, slope = shape_force(i, d, shape), shape_slope(i, d, shape)
    bend = A * shape_bend(i, d, shape)
    soft = 1.0 / (1.0 + s * A * slope)
    loss = gamma * rate * soft * soft
    share = max(1.0 + loss, 0.0)
    elastic = A * phi
    falling = 2.0 * loss * s * soft * elastic if share > 0.0 else 0.0
    f[FORCE, i] = share * elastic
    f[BY_OVERLAP, i] = share * A * slope * soft - falling * bend * soft
    f[BY_STIFFNESS, i] = share * phi * soft - falling * (slope - bend * s * phi * soft)
    f[BY_RATE, i] = gamma * elastic * soft * soft if share > 0.0 else 0.0
    f[BY_LOSS, i] = rate * elastic * soft * soft if share > 0.0 else 0.0
    if d > 0.0:
        for j in range(shape.parameters.shape[0]):
            stronger, steeper = shape_by_parameter(j, i, d, shape)
            f[BY_PARAMETERS + j, i] = share * A * stronger * soft
            f[BY_PARAMETERS + j, i] -= falling * A * (steeper - bend * s * stronger * soft)


@fastmath_inline
def contacts(
    x: Array, v: Array, z: Array, rig: SensitivityRig, shape: ForceShape | None, f: Array
) -> None:
    """All contacts at the positions x and velocities v (n,), and z (2, k) of the modes, into f
    (5 + n_parameters, n_contacts)."""
    phi = rig.phi
    n = x.size
    for i in range(rig.A.size):
        if i < n - 1:
            contact(x[i] - x[i + 1], v[i] - v[i + 1], rig.A, rig.gamma, shape, 0.0, i, f)
        else:
            u, w = 0.0, 0.0
            for j in range(phi.size):
                u += phi[j] * z[0, j]
                w += phi[j] * z[1, j]
            contact(x[i] - u - rig.offset, v[i] - w, rig.A, rig.gamma, shape, rig.residual, i, f)


@fastmath_inline
def accelerations(x: Array, f: Array, rig: SensitivityRig, a: Array) -> None:
    """a_i = (f_{i-1} - f_i + load_i - k_i (x_i - anchor_i)) / m_i into a (n,) [m/s^2], from x (n,)
    and the row FORCE of f (5 + n_parameters, n_contacts)."""
    n = x.size
    for i in range(n):
        net = rig.load[i] - rig.leaf[i] * (x[i] - rig.anchor[i])
        if i > 0:
            net += f[FORCE, i - 1]
        if i < f.shape[1]:
            net -= f[FORCE, i]
        a[i] = net / rig.mass[i]


@fastmath_inline
def contact_sensitivities(
    spheres: SphereDerivatives, modal: Modal, f: Array, phi: Array, slopes: Slopes,
    by_parameters: Array | None, dF: Array,
) -> None:  # fmt: skip
    """Derivatives of all contact forces by the parameters into dF (n_contacts, p), by the chain
    rule from those in f (5 + n_parameters, n_contacts); phi (k,). 0 of a contact without force,
    which has none nearby."""
    X, V, z, Z = spheres.X, spheres.V, modal.z, modal.Z
    n, p = X.shape
    for i in range(f.shape[1]):
        k, by_A, c, by_gamma = f[BY_OVERLAP, i], f[BY_STIFFNESS, i], f[BY_RATE, i], f[BY_LOSS, i]
        if f[FORCE, i] == 0.0:
            dF[i] = 0.0
            continue
        for m in range(p):
            dF[i, m] = (
                k * X[i, m] + c * V[i, m] + by_A * slopes.A[i, m] + by_gamma * slopes.gamma[i, m]
            )
        if by_parameters is not None:
            for j in range(by_parameters.shape[0]):
                for m in range(p):
                    dF[i, m] += f[BY_PARAMETERS + j, i] * by_parameters[j, i, m]
        if i < n - 1:
            for m in range(p):
                dF[i, m] -= k * X[i + 1, m] + c * V[i + 1, m]
            continue
        for m in range(p):
            dF[i, m] -= k * slopes.offset[m]
        for j in range(phi.size):
            for m in range(p):
                dF[i, m] -= phi[j] * (k * Z[0, j, m] + c * Z[1, j, m])
                dF[i, m] -= slopes.phi[j, m] * (k * z[0, j] + c * z[1, j])


@fastmath_inline
def acceleration_sensitivities(
    X: Array, dF: Array, rig: SensitivityRig, d_load: Array, dA: Array
) -> None:
    """Derivatives of `accelerations` by the parameters into dA (n, p)."""
    n, p = X.shape
    for i in range(n):
        minv = 1.0 / rig.mass[i]
        for m in range(p):
            dA[i, m] = minv * (d_load[i, m] - rig.leaf[i] * X[i, m])
        if i > 0:
            for m in range(p):
                dA[i, m] += minv * dF[i - 1, m]
        if i < dF.shape[0]:
            for m in range(p):
                dA[i, m] -= minv * dF[i, m]


@fastmath_inline
def move_modes(
    start: Modal, h: float, s: int, drifts: bool, stages: Stages, rig: SensitivityRig,
    slopes: Slopes, out: Modal,
) -> None:  # fmt: skip
    """out = start + h N_s, the impulse of the force of stage s, which may drift for half a step:
    z <- E z, Z <- E Z + dE z."""
    z, Z, phi, E, by_omega, by_zeta = (
        start.z, start.Z, rig.phi, rig.propagator, rig.by_omega, rig.by_zeta,
    )  # fmt: skip
    force, d_force = stages.force[s], stages.d_force[s]
    for j in range(phi.size):
        q, p = z[0, j], z[1, j] + h * phi[j] * force
        for m in range(d_force.size):
            a, b = Z[0, j, m], Z[1, j, m] + h * (phi[j] * d_force[m] + slopes.phi[j, m] * force)
            out.Z[0, j, m], out.Z[1, j, m] = a, b
            if drifts:
                w, c = slopes.omega[j, m], slopes.zeta[j, m]
                for r in range(2):
                    moved = E[j, r, 0] * a + E[j, r, 1] * b
                    moved += w * (by_omega[j, r, 0] * q + by_omega[j, r, 1] * p)
                    out.Z[r, j, m] = moved + c * (by_zeta[j, r, 0] * q + by_zeta[j, r, 1] * p)
        if drifts:
            q, p = E[j, 0, 0] * q + E[j, 0, 1] * p, E[j, 1, 0] * q + E[j, 1, 1] * p
        out.z[0, j], out.z[1, j] = q, p


@fastmath_inline
def combine(
    x: Array, X: Array, h: float, slope: Array, d_slope: Array, out: Array, d_out: Array
) -> None:
    """out = x + h * slope, (n,) each, and the same for the derivatives (n, p)."""
    for i in range(x.size):
        out[i] = x[i] + h * slope[i]
        for m in range(X.shape[1]):
            d_out[i, m] = X[i, m] + h * d_slope[i, m]


@fastmath_inline
def save(
    step: int, observed: Array, spheres: SphereDerivatives, a: Array, dA: Array,
    record: DerivativeRecord,
) -> None:  # fmt: skip
    """Velocity, acceleration a (n,) and their derivatives of the observed spheres (m,) at a step;
    dA (n, p)."""
    for o in range(observed.size):
        i = observed[o]
        record.v[step, o] = spheres.v[i]
        record.a[step, o] = a[i]
        for m in range(dA.shape[1]):
            record.dv[step, o, m] = spheres.V[i, m]
            record.da[step, o, m] = dA[i, m]


@fastmath_inline
def add(
    spheres: SphereDerivatives, h: float, at_stage: SphereDerivatives, a: Array, dA: Array,
    out: SphereDerivatives,
) -> None:  # fmt: skip
    """out = spheres + h * their rates at a stage, with the accelerations a (n,) and dA (n, p)."""
    combine(spheres.x, spheres.X, h, at_stage.v, at_stage.V, out.x, out.X)
    combine(spheres.v, spheres.V, h, a, dA, out.v, out.V)


class Workspace(NamedTuple):
    """Workspace of a march with sensitivities, with the spheres' start."""

    f: Array  # (5 + n_parameters, n_contacts) as FORCE .. BY_PARAMETERS
    a: Array  # (n,) accelerations
    dF: Array  # (n_contacts, p)
    dA: Array  # (n, p)
    spheres: SphereDerivatives
    at_stage: SphereDerivatives
    total: SphereDerivatives
    modal: Modal
    modal_at_stage: Modal
    half: Modal  # half a step on
    stages: Stages


def workspace(spheres: SphereDerivatives, rig: SensitivityRig) -> Workspace:
    """A Workspace of spheres at their start, modes at rest."""
    (n, p), n_contacts, k = spheres.X.shape, rig.A.size, rig.phi.size
    starts = (SphereDerivatives(*(values.copy() for values in spheres)) for _ in range(3))
    modes = (Modal(np.zeros((2, k)), np.zeros((2, k, p))) for _ in range(3))
    rows = BY_PARAMETERS + (0 if rig.shape is None else len(rig.shape.parameters))
    forces = np.zeros((rows, n_contacts)), np.zeros(n), np.zeros((n_contacts, p)), np.zeros((n, p))
    return Workspace(*forces, *starts, *modes, Stages(np.zeros(4), np.zeros((4, p))))


@fastmath_march
def march(
    work: Workspace, rig: SensitivityRig, slopes: Slopes, dt: float, n_steps: int, observed: Array,
    record: DerivativeRecord,
) -> None:  # fmt: skip
    """March the workspace's spheres by n_steps of dt [s], and record the observed ones (m,).

    Modes at the stages:  z_1 = z,  z_2 = E (z + h/2 N_1),  z_3 = E z + h/2 N_2,
    z_4 = E (E z + h N_3),  and after the step  E E (z + h/6 N_1) + E h/3 (N_2 + N_3) + h/6 N_4.
    """
    f, a, dF, dA, spheres, at_stage, total, modal, modal_at_stage, half, stages = work
    (n, p), n_contacts = dA.shape, rig.A.size
    weights, spans = (dt / 6.0, dt / 3.0, dt / 3.0, dt / 6.0), (0.5 * dt, 0.5 * dt, dt, 0.0)

    # one step more than n_steps, whose first stage is the last one's end
    for step in range(n_steps + 1):
        move_modes(modal, 0.0, 0, dt != 0.0, stages, rig, slopes, half)  # E z

        # stages of the spheres at 0, 1/2, 1/2, 1 of the step, of the modes as above; spans[-1] = 0
        # leaves the first one where it is
        for s in range(4):
            start, force, span = modal if s < 2 else half, max(s - 1, 0), spans[s - 1]
            move_modes(start, span, force, s % 2 == 1, stages, rig, slopes, modal_at_stage)
            contacts(at_stage.x, at_stage.v, modal_at_stage.z, rig, rig.shape, f)
            accelerations(at_stage.x, f, rig, a)
            if p > 0:
                contact_sensitivities(
                    at_stage, modal_at_stage, f, rig.phi, slopes, slopes.parameters, dF
                )
                acceleration_sensitivities(at_stage.X, dF, rig, slopes.load, dA)
            if n_contacts == n:
                stages.force[s] = f[FORCE, n - 1] - rig.rest_force
                for m in range(p):
                    stages.d_force[s, m] = dF[n - 1, m] - slopes.rest_force[m]
            if s == 0:
                save(step, observed, spheres, a, dA, record)
            add(total, weights[s], at_stage, a, dA, total)
            add(spheres, spans[s], at_stage, a, dA, at_stage)

        # the end of the step: of the spheres the weighted sum of all stages, of the modes each
        # stage's impulse before or behind the drift over its half of the step
        add(total, 0.0, total, a, dA, spheres)
        add(total, 0.0, total, a, dA, at_stage)
        for s in range(4):
            move_modes(modal, weights[s], s, s % 2 == 0, stages, rig, slopes, modal)
