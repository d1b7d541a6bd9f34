"""Compiled march of a chain with its sensitivities to parameters: one kernel family of its own.

All of it lives in this one file because a cached compiled function does not notice an edit of
another file (numba #1833). Functions named by a verb change their arrays in place.

Spheres are marched by the classic Runge-Kutta scheme of order 4, the wall's modes by the same
scheme on top of their exact damped rotation (J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372), so
that a fast mode does not limit the step. Differentiating every stage gives the sensitivities of the
discrete solution itself, not of the equation.

`f (5, n_contacts)` has the rows force and its derivatives by overlap, stiffness, approach velocity
and dissipation coefficient. Derivatives by the p parameters are in capitals: X, V (n, p), and Z
(2, k, p) of the modes z (2, k), which are displacement and velocity from the static state; p may
be 0. `directions` are the derivatives of A, gamma, phi, omega, zeta (.., p), load (n, p), the
static displacement of the modes (p,) and the static force at the wall (p,).
"""

import math

import numpy as np
from numba import njit

FAST = {"contract", "reassoc", "nsz", "arcp"}

FORCE, BY_OVERLAP, BY_STIFFNESS, BY_RATE, BY_LOSS = range(5)
D_A, D_GAMMA, D_PHI, D_OMEGA, D_ZETA, D_LOAD, D_OFFSET, D_WALL_FORCE = range(8)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def indentation(gap, A, s):
    """delta of  delta + s A delta^(3/2) = gap, by Newton's method in sqrt(delta)."""
    if gap <= 0.0:
        return 0.0
    if s == 0.0:
        return gap
    e = s * A
    y = math.sqrt(gap)
    if e > 0.0:
        y = min(y, (gap / e) ** (1.0 / 3.0))
    elif 3.0 * gap * e * e >= 4.0 / 9.0:
        return math.nan
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@njit(cache=True, error_model="numpy", fastmath=FAST)
def contact(gap, rate, A, gamma, s, i, f):
    """Force of one contact and its derivatives into column i of f."""
    d = indentation(gap, A, s)
    root = math.sqrt(d)
    soft = 1.0 / (1.0 + 1.5 * s * A * root)
    share = max(1.0 + gamma * rate, 0.0)
    elastic = A * d * root
    f[FORCE, i] = share * elastic
    f[BY_OVERLAP, i] = share * 1.5 * A * root * soft
    f[BY_STIFFNESS, i] = share * d * root * soft
    f[BY_RATE, i] = gamma * elastic if share > 0.0 else 0.0
    f[BY_LOSS, i] = rate * elastic if share > 0.0 else 0.0


@njit(cache=True, error_model="numpy", fastmath=FAST)
def contacts(x, v, z, A, gamma, residual, offset, phi, f):
    """All contacts at a state into f."""
    n = x.size
    for i in range(A.size):
        if i < n - 1:
            contact(x[i] - x[i + 1], v[i] - v[i + 1], A[i], gamma[i], 0.0, i, f)
        else:
            u, w = 0.0, 0.0
            for j in range(phi.size):
                u += phi[j] * z[0, j]
                w += phi[j] * z[1, j]
            contact(x[i] - u - offset, v[i] - w, A[i], gamma[i], residual, i, f)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def accelerations(x, f, mass, load, leaf, anchor, a):
    n = x.size
    for i in range(n):
        net = load[i] - leaf[i] * (x[i] - anchor[i])
        if i > 0:
            net += f[FORCE, i - 1]
        if i < f.shape[1]:
            net -= f[FORCE, i]
        a[i] = net / mass[i]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def contact_tangents(X, V, Z, z, f, phi, directions, dF):
    """Derivatives of all contact forces by the parameters into dF (n_contacts, p)."""
    n, p = X.shape
    d_A, d_gamma, d_phi = directions[D_A], directions[D_GAMMA], directions[D_PHI]
    d_offset = directions[D_OFFSET]
    for i in range(f.shape[1]):
        k, by_A, c, by_gamma = f[BY_OVERLAP, i], f[BY_STIFFNESS, i], f[BY_RATE, i], f[BY_LOSS, i]
        if f[FORCE, i] == 0.0:
            dF[i] = 0.0
            continue
        for m in range(p):
            dF[i, m] = k * X[i, m] + c * V[i, m] + by_A * d_A[i, m] + by_gamma * d_gamma[i, m]
        if i < n - 1:
            for m in range(p):
                dF[i, m] -= k * X[i + 1, m] + c * V[i + 1, m]
            continue
        for m in range(p):
            dF[i, m] -= k * d_offset[m]
        for j in range(phi.size):
            for m in range(p):
                dF[i, m] -= phi[j] * (k * Z[0, j, m] + c * Z[1, j, m])
                dF[i, m] -= d_phi[j, m] * (k * z[0, j] + c * z[1, j])


@njit(cache=True, error_model="numpy", fastmath=FAST)
def acceleration_tangents(X, dF, mass, leaf, d_load, dA):
    n, p = X.shape
    for i in range(n):
        minv = 1.0 / mass[i]
        for m in range(p):
            dA[i, m] = minv * (d_load[i, m] - leaf[i] * X[i, m])
        if i > 0:
            for m in range(p):
                dA[i, m] += minv * dF[i - 1, m]
        if i < dF.shape[0]:
            for m in range(p):
                dA[i, m] -= minv * dF[i, m]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def push_modes(h, force, d_force, phi, d_phi, z, Z):
    """Add an impulse h * force to the modes' velocities, and its derivative to theirs."""
    for j in range(phi.size):
        z[1, j] += h * phi[j] * force
        for m in range(d_force.size):
            Z[1, j, m] += h * (phi[j] * d_force[m] + d_phi[j, m] * force)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def turn_modes(turn, by_omega, by_zeta, d_omega, d_zeta, z, Z):
    """Free motion of the modes: z <- E z, Z <- E Z + dE z, with E (k, 2, 2) and its derivatives."""
    for j in range(z.shape[1]):
        q, p = z[0, j], z[1, j]
        for m in range(Z.shape[2]):
            a, b = Z[0, j, m], Z[1, j, m]
            w, c = d_omega[j, m], d_zeta[j, m]
            for r in range(2):
                moved = turn[j, r, 0] * a + turn[j, r, 1] * b
                moved += w * (by_omega[j, r, 0] * q + by_omega[j, r, 1] * p)
                Z[r, j, m] = moved + c * (by_zeta[j, r, 0] * q + by_zeta[j, r, 1] * p)
        z[0, j] = turn[j, 0, 0] * q + turn[j, 0, 1] * p
        z[1, j] = turn[j, 1, 0] * q + turn[j, 1, 1] * p


@njit(cache=True, error_model="numpy", fastmath=FAST)
def combine(x, X, h, slope, d_slope, out, d_out):
    """out = x + h * slope, and the same for the derivatives."""
    for i in range(x.size):
        out[i] = x[i] + h * slope[i]
        for m in range(X.shape[1]):
            d_out[i, m] = X[i, m] + h * d_slope[i, m]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def stage_modes(s, dt, z, Z, half, d_half, force, d_force, wall, directions, zs, Zs):
    """Modes at the s-th stage of a step into zs, Zs; `half` holds them turned by half a step.

    z_1 = z,  z_2 = E (z + h/2 N_1),  z_3 = E z + h/2 N_2,  z_4 = E (E z + h N_3).
    """
    phi, turn, by_omega, by_zeta = wall[3], wall[4], wall[5], wall[6]
    d_phi, d_omega, d_zeta = directions[D_PHI], directions[D_OMEGA], directions[D_ZETA]
    if s < 2:
        zs[:] = z
        Zs[:] = Z
    else:
        zs[:] = half
        Zs[:] = d_half
    if s > 0:
        h = dt if s == 3 else 0.5 * dt
        push_modes(h, force[s - 1], d_force[s - 1], phi, d_phi, zs, Zs)
    if s == 1 or s == 3:
        turn_modes(turn, by_omega, by_zeta, d_omega, d_zeta, zs, Zs)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def advance_modes(dt, force, d_force, wall, directions, z, Z):
    """z <- E E (z + h/6 N_1) + E h/3 (N_2 + N_3) + h/6 N_4, in place."""
    phi, turn, by_omega, by_zeta = wall[3], wall[4], wall[5], wall[6]
    d_phi, d_omega, d_zeta = directions[D_PHI], directions[D_OMEGA], directions[D_ZETA]
    push_modes(dt / 6.0, force[0], d_force[0], phi, d_phi, z, Z)
    turn_modes(turn, by_omega, by_zeta, d_omega, d_zeta, z, Z)
    push_modes(dt / 3.0, force[1], d_force[1], phi, d_phi, z, Z)
    push_modes(dt / 3.0, force[2], d_force[2], phi, d_phi, z, Z)
    turn_modes(turn, by_omega, by_zeta, d_omega, d_zeta, z, Z)
    push_modes(dt / 6.0, force[3], d_force[3], phi, d_phi, z, Z)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def save(step, observed, v, V, a, dA, out):
    """Velocity, acceleration and their derivatives of the observed spheres at a step."""
    for o in range(observed.size):
        out[0][step, o] = v[observed[o]]
        out[1][step, o] = a[observed[o]]
        out[2][step, o] = V[observed[o]]
        out[3][step, o] = dA[observed[o]]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def march(x, v, X, V, A, gamma, spheres, wall, directions, dt, n_steps, observed, out):
    """March x, v and X, V in place; out: velocity and acceleration (n_steps + 1, m) of the m
    observed spheres and their derivatives (n_steps + 1, m, p).

    spheres: mass, load, leaf stiffness, leaf anchor (n,); wall: residual compliance, static
    displacement, static force, phi (k,), turn by half a step and its derivatives by omega and
    zeta (k, 2, 2).
    """
    n, p = X.shape
    n_contacts, k = A.size, wall[3].size
    mass, load, leaf, anchor = spheres
    residual, offset, wall_force, phi = wall[0], wall[1], wall[2], wall[3]
    f, a = np.zeros((5, n_contacts)), np.zeros(n)
    dF, dA = np.zeros((n_contacts, p)), np.zeros((n, p))
    z, zs, half = np.zeros((2, k)), np.zeros((2, k)), np.zeros((2, k))
    Z, Zs, d_half = np.zeros((2, k, p)), np.zeros((2, k, p)), np.zeros((2, k, p))
    xs, vs, Xs, Vs = x.copy(), v.copy(), X.copy(), V.copy()
    x_sum, v_sum, X_sum, V_sum = x.copy(), v.copy(), X.copy(), V.copy()
    force, d_force = np.zeros(4), np.zeros((4, p))
    weights, reaches = (dt / 6.0, dt / 3.0, dt / 3.0, dt / 6.0), (0.5 * dt, 0.5 * dt, dt, 0.0)
    for step in range(n_steps + 1):
        stage_modes(1, 0.0, z, Z, z, Z, force, d_force, wall, directions, half, d_half)
        for s in range(4):
            stage_modes(s, dt, z, Z, half, d_half, force, d_force, wall, directions, zs, Zs)
            contacts(xs, vs, zs, A, gamma, residual, offset, phi, f)
            accelerations(xs, f, mass, load, leaf, anchor, a)
            contact_tangents(Xs, Vs, Zs, zs, f, phi, directions, dF)
            acceleration_tangents(Xs, dF, mass, leaf, directions[D_LOAD], dA)
            if n_contacts == n:
                force[s] = f[FORCE, n - 1] - wall_force
                d_force[s] = dF[n - 1] - directions[D_WALL_FORCE]
            if s == 0:
                save(step, observed, v, V, a, dA, out)
            combine(x_sum, X_sum, weights[s], vs, Vs, x_sum, X_sum)
            combine(v_sum, V_sum, weights[s], a, dA, v_sum, V_sum)
            combine(x, X, reaches[s], vs, Vs, xs, Xs)
            combine(v, V, reaches[s], a, dA, vs, Vs)
        x[:], v[:], X[:], V[:] = x_sum, v_sum, X_sum, V_sum
        xs[:], vs[:], Xs[:], Vs[:] = x_sum, v_sum, X_sum, V_sum
        advance_modes(dt, force, d_force, wall, directions, z, Z)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def stage_modes_alone(s, dt, z, half, force, phi, turn, zs):
    """`stage_modes` without derivatives."""
    h = 0.0 if s == 0 else dt if s == 3 else 0.5 * dt
    for j in range(phi.size):
        q, p = (z[0, j], z[1, j]) if s < 2 else (half[0, j], half[1, j])
        p += h * phi[j] * force[max(s - 1, 0)]
        if s == 1 or s == 3:
            q, p = turn[j, 0, 0] * q + turn[j, 0, 1] * p, turn[j, 1, 0] * q + turn[j, 1, 1] * p
        zs[0, j], zs[1, j] = q, p


@njit(cache=True, error_model="numpy", fastmath=FAST)
def advance_modes_alone(dt, force, phi, turn, z, half):
    """`advance_modes` without derivatives; `half` gets the modes turned on by half a step."""
    for j in range(phi.size):
        q, p = z[0, j], z[1, j] + dt / 6.0 * phi[j] * force[0]
        q, p = turn[j, 0, 0] * q + turn[j, 0, 1] * p, turn[j, 1, 0] * q + turn[j, 1, 1] * p
        p += dt / 3.0 * phi[j] * (force[1] + force[2])
        q, p = turn[j, 0, 0] * q + turn[j, 0, 1] * p, turn[j, 1, 0] * q + turn[j, 1, 1] * p
        p += dt / 6.0 * phi[j] * force[3]
        z[0, j], z[1, j] = q, p
        half[0, j] = turn[j, 0, 0] * q + turn[j, 0, 1] * p
        half[1, j] = turn[j, 1, 0] * q + turn[j, 1, 1] * p


@njit(cache=True, error_model="numpy", fastmath=FAST)
def march_alone(x, v, A, gamma, spheres, wall, dt, n_steps, observed, out):
    """`march` without derivatives, in a third of the time."""
    n, n_contacts, k = x.size, A.size, wall[3].size
    mass, load, leaf, anchor = spheres
    residual, offset, wall_force, phi, turn = wall[0], wall[1], wall[2], wall[3], wall[4]
    f, a, force = np.zeros((5, n_contacts)), np.zeros(n), np.zeros(4)
    z, zs, half = np.zeros((2, k)), np.zeros((2, k)), np.zeros((2, k))
    xs, vs, x_sum, v_sum = x.copy(), v.copy(), x.copy(), v.copy()
    weights, reaches = (dt / 6.0, dt / 3.0, dt / 3.0, dt / 6.0), (0.5 * dt, 0.5 * dt, dt, 0.0)
    for step in range(n_steps + 1):
        for s in range(4):
            stage_modes_alone(s, dt, z, half, force, phi, turn, zs)
            contacts(xs, vs, zs, A, gamma, residual, offset, phi, f)
            accelerations(xs, f, mass, load, leaf, anchor, a)
            if n_contacts == n:
                force[s] = f[FORCE, n - 1] - wall_force
            if s == 0:
                for o in range(observed.size):
                    out[0][step, o], out[1][step, o] = v[observed[o]], a[observed[o]]
            weight, reach = weights[s], reaches[s]
            for i in range(n):
                x_sum[i] += weight * vs[i]
                v_sum[i] += weight * a[i]
                xs[i] = x[i] + reach * vs[i]
                vs[i] = v[i] + reach * a[i]
        for i in range(n):
            x[i] = xs[i] = x_sum[i]
            v[i] = vs[i] = v_sum[i]
        advance_modes_alone(dt, force, phi, turn, z, half)
