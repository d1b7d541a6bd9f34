"""Every compiled function of the chain: contact forces, kicks, drifts, the march, the statics.

All of them live in this one file because a cached compiled function does not notice an edit of
another file (numba #1833). A part that a chain lacks is `None`: its branch is not compiled.

Kick and drift change their arrays in place. `f (n + 1,)` holds the contact forces with f[0] = 0
before the first sphere and f[n] at the wall (0 for a free chain). `wall (4,)` is the running state
of the wall: displacement u_w and velocity v_w of the modes, displacement u_d of the dashpot,
work done on the modes. Modes are measured from the static state, so a chain at rest in
equilibrium stays there exactly.
"""

import math

import numpy as np
from numba import njit

FAST = {"contract", "reassoc", "nsz", "arcp"}

NONE, LINEAR, LINEAR_CLIPPED, HUNT_CROSSLEY = range(4)
U, V, DASH, WORK = range(4)


@njit(cache=True, fastmath=FAST)
def hertz_indentation(gap, A, s):
    """delta of  delta + s A delta^(3/2) = gap: a Hertz contact and a spring s in series.

    NaN beyond the fold of a negative s, where no force answers the gap.
    """
    if gap <= 0.0:
        return 0.0
    e = s * A
    y = math.sqrt(gap)
    if e > 0.0:
        y = min(y, (gap / e) ** (1.0 / 3.0))
    elif e < 0.0:
        top = -2.0 / (3.0 * e)
        if 3.0 * gap >= top * top:
            return math.nan
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if e < 0.0:
            y = min(y, 0.999999 * top)
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@njit(cache=True, fastmath=FAST)
def sphere_forces(x, A, f):
    for i in range(x.size - 1):
        d = max(x[i] - x[i + 1], 0.0)
        f[i + 1] = A[i] * d * math.sqrt(d)


@njit(cache=True, fastmath=FAST)
def wall_indentation(x, A, wall, offset, residual):
    gap = x[-1] - wall[U] - wall[DASH] - offset
    if residual is None:
        return max(gap, 0.0)
    return hertz_indentation(gap, A[-1], residual)


@njit(cache=True, fastmath=FAST)
def dashpot_indentation(d, dt, A, residual, mobility):
    """Indentation after dt of creep  d(gap)/dt = -mobility A d^(3/2)  at a fixed sphere.

    With a spring s in series the creep is  -2 y^-1 + 3 s A ln y = const - mobility A t,
    y = sqrt(d), which keeps y > 0.
    """
    if d <= 0.0:
        return 0.0
    y = math.sqrt(d)
    if residual is None:
        y = y / (1.0 + 0.5 * mobility * A * y * dt)
        return y * y
    e = residual * A
    target = 2.0 / y - 3.0 * e * math.log(y) + mobility * A * dt
    z = 1.0 / y + 0.5 * mobility * A * dt / (1.0 + 1.5 * e * y)
    for _ in range(60):
        change = (target - 2.0 * z - 3.0 * e * math.log(z)) / (2.0 + 3.0 * e / z)
        z = max(z + change, 0.1 * z)
        if abs(change) <= 1e-15 * z:
            break
    return 1.0 / (z * z)


@njit(cache=True, fastmath=FAST)
def wall_force(x, dt, A, wall, ledger, offset, residual, mobility):
    """Mean force at the wall over a kick of length dt; moves the dashpot wall."""
    d = wall_indentation(x, A, wall, offset, residual)
    force = A[-1] * d * math.sqrt(d)
    if mobility is None:
        return force
    d_new = dashpot_indentation(d, dt, A[-1], residual, mobility)
    force_new = A[-1] * d_new * math.sqrt(d_new)
    moved = d - d_new
    ledger[1] += 0.4 * (force * d - force_new * d_new)
    if residual is not None:
        moved += residual * (force - force_new)
        ledger[1] += 0.5 * residual * (force * force - force_new * force_new)
    wall[DASH] += moved
    return moved / (mobility * dt)


@njit(cache=True, fastmath=FAST)
def push_modes(impulse, wall, modes):
    p, phi = modes[1], modes[2]
    square = modes[3]
    for j in range(p.size):
        p[j] += phi[j] * impulse
    wall[WORK] += impulse * (wall[V] + 0.5 * square * impulse)
    wall[V] += square * impulse


@njit(cache=True, fastmath=FAST)
def push_spheres(v, dt, f, minv, load):
    for i in range(v.size):
        v[i] += dt * minv[i] * (f[i] - f[i + 1])
    if load is not None:
        for i in range(v.size):
            v[i] += dt * minv[i] * load[i]


@njit(cache=True, fastmath=FAST)
def elastic_kick(dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility, modes):
    if A.size == x.size:
        f[x.size] = wall_force(x, dt, A, wall, ledger, offset, residual, mobility)
    push_spheres(v, dt, f, minv, load)
    if modes is not None:
        push_modes(dt * (f[x.size] - modes[4]), wall, modes)


@njit(cache=True, fastmath=FAST)
def damping_impulse(w, dt, force, c, inverse_mass, clipped):
    """Impulse of a damper c on two bodies that approach at w, exact at frozen positions.

    Clipped, the damper never outweighs the elastic force, so the contact never pulls.
    """
    done = 0.0
    if clipped and c * w < -force:
        if dt < 0.0:
            return -force * dt
        reach = (-force / c - w) / (force * inverse_mass) if force > 0.0 else math.inf
        if reach >= dt:
            return -force * dt
        done = -force * reach
        w = -force / c
        dt -= reach
    z = c * inverse_mass * dt
    if abs(z) < 1e-3:
        return done + c * w * dt * (
            1.0 - z * (0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z / 120.0)))
        )
    return done - w / inverse_mass * math.expm1(-z)


@njit(cache=True, fastmath=FAST)
def damper(i, force, d, gamma, law):
    """Coefficient c of the damping force c (approach velocity) of contact i."""
    if law == HUNT_CROSSLEY:
        return gamma[i] * force
    return gamma[i] if d > 0.0 else 0.0


@njit(cache=True, fastmath=FAST)
def damp_contacts(first, dt, x, v, f, minv, A, wall, ledger, offset, dissipation, modes):
    """Every second contact, from `first` on: they share no sphere."""
    gamma, law, inverse_mass = dissipation
    n = x.size
    for i in range(first, A.size, 2):
        force = f[i + 1]
        if i < n - 1:
            c = damper(i, force, x[i] - x[i + 1], gamma, law)
            w = v[i] - v[i + 1]
        else:
            c = damper(i, force, x[i] - wall[U] - wall[DASH] - offset, gamma, law)
            w = v[i] - wall[V]
        if c == 0.0:
            continue
        impulse = damping_impulse(w, dt, force, c, inverse_mass[i], law != LINEAR)
        ledger[0] += impulse * (w - 0.5 * inverse_mass[i] * impulse)
        v[i] -= impulse * minv[i]
        if i < n - 1:
            v[i + 1] += impulse * minv[i + 1]
        elif modes is not None:
            push_modes(impulse, wall, modes)


@njit(cache=True, fastmath=FAST)
def kick(dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility, modes, dissipation):
    """v += dt F(x)/m on spheres and modes."""
    sphere_forces(x, A, f)
    if dissipation is None:
        elastic_kick(dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility, modes)
    else:
        elastic_kick(
            0.5 * dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility, modes
        )
        damp_contacts(0, 0.5 * dt, x, v, f, minv, A, wall, ledger, offset, dissipation, modes)
        damp_contacts(1, dt, x, v, f, minv, A, wall, ledger, offset, dissipation, modes)
        damp_contacts(0, 0.5 * dt, x, v, f, minv, A, wall, ledger, offset, dissipation, modes)
        elastic_kick(
            0.5 * dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility, modes
        )


@njit(cache=True, fastmath=FAST)
def rotate_modes(k, wall, modes):
    """Exact free motion of the damped modes over the k-th drift of the schedule."""
    q, p, phi, turn = modes[0], modes[1], modes[2], modes[5]
    qq, qp, pq, pp = turn[k, 0], turn[k, 1], turn[k, 2], turn[k, 3]
    u = 0.0
    w = 0.0
    for j in range(q.size):
        q_new = qq[j] * q[j] + qp[j] * p[j]
        p_new = pq[j] * q[j] + pp[j] * p[j]
        q[j] = q_new
        p[j] = p_new
        u += phi[j] * q_new
        w += phi[j] * p_new
    wall[U] = u
    wall[V] = w


@njit(cache=True, fastmath=FAST)
def drift(k, dt, x, v, wall, leaf, modes):
    """Free flight, or exact swing on the leaf springs, and exact free motion of the wall."""
    if leaf is None:
        for i in range(x.size):
            x[i] += dt * v[i]
    else:
        rest, turn = leaf
        xx, xv, vx = turn[k, 0], turn[k, 1], turn[k, 2]
        for i in range(x.size):
            u = x[i] - rest[i]
            x[i] = rest[i] + xx[i] * u + xv[i] * v[i]
            v[i] = vx[i] * u + xx[i] * v[i]
    if modes is not None:
        rotate_modes(k, wall, modes)


@njit(cache=True)
def total_forces(x, v, f, A, wall, offset, residual, mobility, dissipation):
    """Contact forces at an instant, dissipative part included, into f; elastic energies out."""
    n = x.size
    contact = 0.0
    spring = 0.0
    for i in range(A.size):
        w = v[i] - wall[V]
        if i < n - 1:
            d = max(x[i] - x[i + 1], 0.0)
            w = v[i] - v[i + 1]
        else:
            d = wall_indentation(x, A, wall, offset, residual)
        force = A[i] * d * math.sqrt(d)
        contact += 0.4 * force * d
        if i == n - 1 and residual is not None:
            spring = 0.5 * residual * force * force
        if dissipation is not None:
            extra = damper(i, force, d, dissipation[0], dissipation[1]) * w
            if dissipation[1] != LINEAR:
                extra = max(extra, -force)
            force += extra
        f[i + 1] = force
    return contact, spring


@njit(cache=True)
def modal_energy(modes):
    """Energy of the modes about the static state, and in all."""
    q, p, static, omega = modes[0], modes[1], modes[6], modes[7]
    swing = 0.0
    absolute = 0.0
    for j in range(q.size):
        swing += 0.5 * (p[j] ** 2 + (omega[j] * q[j]) ** 2)
        absolute += 0.5 * (p[j] ** 2 + omega[j] ** 2 * (q[j] + static[j]) ** 2)
    return swing, absolute


@njit(cache=True)
def save(
    k, x, v, f, mass, A, wall, ledger, offset, residual, mobility, modes, dissipation,
    leaf_springs, preload, out,
):  # fmt: skip
    """Row k of the saved states, forces and energies."""
    xs, vs, fs, walls, energies = out
    contact, spring = total_forces(x, v, f, A, wall, offset, residual, mobility, dissipation)
    kinetic = 0.0
    for i in range(x.size):
        xs[k, i] = x[i]
        vs[k, i] = v[i]
        kinetic += 0.5 * mass[i] * v[i] ** 2
    for i in range(A.size):
        fs[k, i] = f[i + 1]
    energies[k, 0] = kinetic
    energies[k, 1] = contact
    if leaf_springs is not None:
        stiffness, anchor = leaf_springs
        for i in range(x.size):
            energies[k, 2] += 0.5 * stiffness[i] * (x[i] - anchor[i]) ** 2
    energies[k, 4] = spring
    energies[k, 5] = ledger[0]
    energies[k, 6] = ledger[1]
    walls[k, 0] = wall[U] + wall[DASH] + offset
    walls[k, 1] = wall[V]
    if mobility is not None:
        walls[k, 1] += mobility * f[x.size]
    if modes is not None:
        swing, absolute = modal_energy(modes)
        energies[k, 3] = absolute
        energies[k, 6] += wall[WORK] - swing
    energies[k, 7] = preload * (x[-1] - xs[0, -1])


@njit(cache=True)
def march(
    x, v, mass, A, schedule, dt, n_save, stride, load, leaf, leaf_springs, preload,
    offset, residual, mobility, modes, dissipation, wall, out,
):  # fmt: skip
    """n_save times stride steps; the state is saved before and after each stride.

    Changes x, v and the modes in place. Ends early, and says after how many saves, when a state is
    not finite.
    """
    lead_b, lead_a, b, a, end_b, end_a = schedule
    n_stages = b.size
    f = np.zeros(x.size + 1)
    ledger = np.zeros(2)
    minv = 1.0 / mass
    save(
        0, x, v, f, mass, A, wall, ledger, offset, residual, mobility, modes, dissipation,
        leaf_springs, preload, out,
    )  # fmt: skip
    for k in range(1, n_save + 1):
        if lead_b != 0.0:
            kick(
                lead_b * dt, x, v, f, minv, A, load, wall, ledger, offset, residual, mobility,
                modes, dissipation,
            )  # fmt: skip
        drift(n_stages, lead_a * dt, x, v, wall, leaf, modes)
        for step in range(stride):
            for i in range(n_stages):
                last = step == stride - 1 and i == n_stages - 1
                kick(
                    (end_b if last else b[i]) * dt, x, v, f, minv, A, load, wall, ledger,
                    offset, residual, mobility, modes, dissipation,
                )  # fmt: skip
                if not last:
                    drift(i, a[i] * dt, x, v, wall, leaf, modes)
                elif end_a != 0.0:
                    drift(n_stages + 1, end_a * dt, x, v, wall, leaf, modes)
        save(
            k, x, v, f, mass, A, wall, ledger, offset, residual, mobility, modes, dissipation,
            leaf_springs, preload, out,
        )  # fmt: skip
        total = 0.0
        for e in range(8):
            total += out[4][k, e]
        if not math.isfinite(total):
            return k
    return n_save


@njit(cache=True)
def static_residual(x, A, stiffness, anchor, preload, compliance, f, r):
    """Net force on every sphere at rest into r, contact forces into f."""
    n = x.size
    f[n] = 0.0
    for i in range(A.size):
        if i < n - 1:
            d = max(x[i] - x[i + 1], 0.0)
        else:
            d = hertz_indentation(x[i], A[i], compliance)
        f[i + 1] = A[i] * d * math.sqrt(d)
    for i in range(n):
        r[i] = f[i] - f[i + 1] - stiffness[i] * (x[i] - anchor[i])
    r[n - 1] += preload


@njit(cache=True)
def static_slope(x, A, stiffness, compliance, k):
    """Tangent stiffness of every contact into k."""
    n = x.size
    for i in range(A.size):
        if i < n - 1:
            k[i] = 1.5 * A[i] * math.sqrt(max(x[i] - x[i + 1], 0.0))
        else:
            hertz = 1.5 * A[i] * math.sqrt(hertz_indentation(x[i], A[i], compliance))
            k[i] = hertz / (1.0 + compliance * hertz)


@njit(cache=True)
def thomas(lower, diagonal, rhs):
    """Solution of a symmetric tridiagonal system; overwrites its arguments."""
    n = diagonal.size
    for i in range(1, n):
        factor = lower[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * lower[i - 1]
        rhs[i] -= factor * rhs[i - 1]
    rhs[n - 1] /= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        rhs[i] = (rhs[i] - lower[i] * rhs[i + 1]) / diagonal[i]
    return rhs


@njit(cache=True)
def rest(x, A, stiffness, anchor, preload, compliance, floor, n_iterations):
    """Damped Newton for the static state, from x and in place; the net force that is left, out.

    `floor` [N/m] keeps the tangent regular while contacts are open; it fades with the net force.
    """
    n = x.size
    f = np.zeros(n + 1)
    r = np.zeros(n)
    k = np.zeros(n)
    static_residual(x, A, stiffness, anchor, preload, compliance, f, r)
    norm = math.sqrt((r * r).sum())
    start = norm
    diagonal = np.empty(n)
    for _ in range(n_iterations):
        if norm == 0.0:
            break
        static_slope(x, A, stiffness, compliance, k)
        for i in range(n):
            diagonal[i] = stiffness[i] + k[i] + (k[i - 1] if i > 0 else 0.0)
            diagonal[i] += floor * (norm / start)
        change = thomas(-k[: n - 1], diagonal, r.copy())
        scale = 1.0
        better = False
        for _halving in range(40):
            trial = x + scale * change
            static_residual(trial, A, stiffness, anchor, preload, compliance, f, r)
            trial_norm = math.sqrt((r * r).sum())
            better = trial_norm < norm
            if better:
                break
            scale *= 0.5
        if not better:
            break
        x[:] = trial
        norm = trial_norm
    return norm
