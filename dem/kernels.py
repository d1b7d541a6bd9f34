"""Compiled marches of the chain: explicit, implicit, and many bare chains side by side.

They live in this one file because they share the contact laws, the mending and the saving, and a
cached compiled function does not notice an edit of another file (numba #1833). A part that a chain
lacks is `None`: its branch is not compiled.

Functions named by a verb change their arrays in place. `f (n + 1,)` holds the contact forces, f[0]
= 0 before the first sphere and f[n] at the wall (0 for a free chain). `modal` holds q, p, phi,
omega and the static displacement of the modes, (k,) each, all measured from the static state, so
that a chain at rest in equilibrium stays there exactly; `wall (4,)` is displacement u_w = phi q and
velocity v_w = phi p of the modes, displacement u_d of the dashpot, work done on the modes. `ledger
(2,)` is the energy lost in the contacts and in the dashpot.

A contact that opens or closes inside a step costs any scheme all but order 2.5, because its force
starts like tau^(3/2). The end correction for that singularity is known: a composite quadrature
with nodes c and weights b misses the integral of (t - t_c)^p by  -h^(p+1) sum b zeta(-p, c - theta)
with Hurwitz' zeta and theta = (t_c - t_0)/h  (I. Navot, J. Math. Phys. 40 (1961) 271; J. N.
Lyness, B. W. Ninham, Math. Comput. 21 (1967) 162). `mend_crossings` adds it as an impulse.
"""

import math

import numpy as np
from numba import njit

FAST = {"contract", "reassoc", "nsz", "arcp"}

NONE, LINEAR, LINEAR_CLIPPED, HUNT_CROSSLEY = range(4)
U, V, DASH, WORK = range(4)
TOP, COEFFICIENT, CRATER = range(3)
LANES = 16

# `_nrt=False`: no reference counts, which would cost more than the arithmetic of a short chain
exact = njit(cache=True, error_model="numpy", _nrt=False)
quick = njit(cache=True, error_model="numpy", _nrt=False, fastmath=FAST)
exact_inner = njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
inner = njit(cache=True, error_model="numpy", _nrt=False, fastmath=FAST, forceinline=True)


# --- contact laws ------------------------------------------------------------------------------


@quick
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
    if y == 0.0:
        return 0.0
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if e < 0.0:
            y = min(y, 0.999999 * top)
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@quick
def plastic_force(i, d, A, plastic):
    """Thornton's elastic-plastic contact: Hertz up to its yield overlap, straight on beyond, back
    on the Hertz law of the flattened surface."""
    limit, history = plastic
    if d > history[TOP, i]:
        yielded = A[i] * limit[i] * math.sqrt(limit[i])
        return yielded * (1.0 + 1.5 * (d - limit[i]) / limit[i])
    e = max(d - history[CRATER, i], 0.0)
    return history[COEFFICIENT, i] * e * math.sqrt(e)


@quick
def plastic_indentation(gap, A, residual, plastic):
    """delta of  delta + s F(delta) = gap  at the last contact."""
    if residual is None or gap <= 0.0:
        return max(gap, 0.0)
    last = A.size - 1
    low, high = 0.0, gap
    if residual < 0.0:
        high = gap - residual * plastic_force(last, 2.0 * gap, A, plastic)
    for _ in range(100):
        d = 0.5 * (low + high)
        if d + residual * plastic_force(last, d, A, plastic) > gap:
            high = d
        else:
            low = d
        if high - low <= 4e-16 * gap:
            break
    return 0.5 * (low + high)


@exact
def plastic_loss(i, top, A, plastic):
    """Work lost for good once contact i has been pressed to the overlap `top`; also the
    coefficient of the flattened surface and its crater."""
    limit = plastic[0][i]
    yielded = A[i] * limit * math.sqrt(limit)
    beyond = (top - limit) / limit
    force = yielded * (1.0 + 1.5 * beyond)
    flat = yielded / force * ((2.0 * force + yielded) / (3.0 * yielded)) ** 1.5
    coefficient = A[i] * math.sqrt(flat)
    elastic = (force / coefficient) ** (2.0 / 3.0)
    work = yielded * limit * (0.4 + beyond + 0.75 * beyond * beyond)
    return work - 0.4 * force * elastic, coefficient, top - elastic


@quick
def sphere_forces(x, A, f, plastic):
    """Elastic forces between neighbours into f[1:n]."""
    for i in range(x.size - 1):
        d = x[i] - x[i + 1]
        if plastic is None:
            d = d if d > 0.0 else 0.0
            f[i + 1] = A[i] * d * math.sqrt(d)
        else:
            f[i + 1] = plastic_force(i, d, A, plastic)


@quick
def wall_indentation(gap, A, residual):
    if residual is None:
        return max(gap, 0.0)
    return hertz_indentation(gap, A, residual)


@quick
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


@quick
def creep(d, dt, A, wall, ledger, residual, mobility):
    """Move the dashpot wall for dt; its mean force."""
    force = A * d * math.sqrt(d)
    d_new = dashpot_indentation(d, dt, A, residual, mobility)
    force_new = A * d_new * math.sqrt(d_new)
    moved = d - d_new
    ledger[1] += 0.4 * (force * d - force_new * d_new)
    if residual is not None:
        moved += residual * (force - force_new)
        ledger[1] += 0.5 * residual * (force * force - force_new * force_new)
    wall[DASH] += moved
    return moved / (mobility * dt)


@quick
def wall_force(x, dt, A, wall, ledger, offset, residual, mobility, plastic):
    """Mean force at the wall over a kick of length dt; moves the dashpot wall."""
    last = x.size - 1
    gap = x[last] - wall[U] - wall[DASH] - offset
    if plastic is not None:
        d = plastic_indentation(gap, A, residual, plastic)
        return plastic_force(last, d, A, plastic)
    d = wall_indentation(gap, A[last], residual)
    if mobility is not None:
        return creep(d, dt, A[last], wall, ledger, residual, mobility)
    return A[last] * d * math.sqrt(d)


# --- kicks and drifts --------------------------------------------------------------------------


@quick
def push_spheres(v, dt, f, minv, load):
    if load is None:
        for i in range(v.size):
            v[i] += dt * minv[i] * (f[i] - f[i + 1])
    else:
        for i in range(v.size):
            v[i] += dt * minv[i] * (f[i] - f[i + 1] + load[i])


@quick
def kick_and_drift(kick, drift, x, v, A, f, minv):
    """Forces, kick and free flight of bare spheres in one pass; f[n], at the wall, is given."""
    last = v.size - 1
    before = 0.0
    for i in range(last):
        here = x[i]
        d = here - x[i + 1]
        d = d if d > 0.0 else 0.0
        force = A[i] * d * math.sqrt(d)
        speed = v[i] + kick * minv[i] * (before - force)
        f[i + 1] = force
        v[i] = speed
        x[i] = here + drift * speed
        before = force
    v[last] += kick * minv[last] * (before - f[last + 1])
    x[last] += drift * v[last]


@inner
def push_and_drift(kick, drift, x, v, f, minv):
    """The same with forces that are known."""
    for i in range(v.size):
        speed = v[i] + kick * minv[i] * (f[i] - f[i + 1])
        v[i] = speed
        x[i] += drift * speed


@inner
def push_wall(impulse, square, wall):
    wall[WORK] += impulse * (wall[V] + 0.5 * square * impulse)
    wall[V] += square * impulse


@inner
def push_modes(impulse, square, wall, modal):
    _, p, phi, _, _ = modal
    for j in range(p.size):
        p[j] += phi[j] * impulse
    push_wall(impulse, square, wall)


@quick
def drift_spheres(k, dt, x, v, leaf):
    """Free flight, or the exact swing on the leaf springs by the k-th drift."""
    if leaf is None:
        for i in range(x.size):
            x[i] += dt * v[i]
    else:
        rest, turn = leaf
        for i in range(x.size):
            u = x[i] - rest[i]
            x[i] = rest[i] + turn[k, 0, i] * u + turn[k, 1, i] * v[i]
            v[i] = turn[k, 2, i] * u + turn[k, 0, i] * v[i]


@inner
def drift_modes(k, impulse, wall, modal, turn):
    """Exact free motion of the damped modes by the k-th drift after an impulse at the wall."""
    q, p, phi, _, _ = modal
    qq, qp, pq, pp = turn[k, 0], turn[k, 1], turn[k, 2], turn[k, 3]
    u = 0.0
    w = 0.0
    for j in range(q.size):
        r = phi[j]
        here = q[j]
        speed = p[j] + r * impulse
        there = qq[j] * here + qp[j] * speed
        speed = pq[j] * here + pp[j] * speed
        q[j] = there
        p[j] = speed
        u += r * there
        w += r * speed
    wall[U] = u
    wall[V] = w


@inner
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
    if abs(z) < 0.02:
        share = 1.0 / 24.0 - z * (1.0 / 120.0 - z * (1.0 / 720.0 - z * (1.0 / 5040.0)))
        return done + c * w * dt * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z * share)))
    return done - w / inverse_mass * math.expm1(-z)


@inner
def damper(i, force, gamma, law):
    """Coefficient c of the damping force c (approach velocity) of contact i."""
    if law == HUNT_CROSSLEY:
        return gamma[i] * force
    return gamma[i] if force > 0.0 else 0.0


@inner
def damp_contacts(first, dt, v, f, minv, n_contacts, wall, ledger, dissipation, square, modal):
    """Every second contact, from `first` on: they share no sphere."""
    gamma, law, inverse_mass = dissipation
    n = v.size
    for i in range(first, n_contacts, 2):
        w = v[i] - (v[i + 1] if i < n - 1 else wall[V])
        c = damper(i, f[i + 1], gamma, law)
        if c == 0.0:
            continue
        impulse = damping_impulse(w, dt, f[i + 1], c, inverse_mass[i], law != LINEAR)
        ledger[0] += impulse * (w - 0.5 * inverse_mass[i] * impulse)
        v[i] -= impulse * minv[i]
        if i < n - 1:
            v[i + 1] += impulse * minv[i + 1]
        elif modal is not None:
            push_modes(impulse, square, wall, modal)


# --- contacts that open, close or yield within a step ------------------------------------------


@exact
def zeta_sums(theta, b, c, tail):
    """sum b zeta(-p, c - theta), p = 3/2, 5/2, 7/2, over the nodes of this and all later steps but
    those before theta. `tail (3, m)` holds what starts two steps on, polynomials in 2 theta - 1."""
    z = 2.0 * theta - 1.0
    s3, s5, s7 = 0.0, 0.0, 0.0
    for k in range(tail.shape[1]):
        s3 = s3 * z + tail[0, k]
        s5 = s5 * z + tail[1, k]
        s7 = s7 * z + tail[2, k]
    for i in range(b.size):
        s = max(c[i] - theta, 0.0)
        e = max(c[i] - theta + 1.0, 0.0)
        near = b[i] * s * math.sqrt(s)
        far = b[i] * e * math.sqrt(e)
        s3 += near + far
        s5 += near * s + far * e
        s7 += near * s * s + far * e * e
    return s3, s5, s7


@exact
def crossing(g0, r0, g1, r1):
    """Zero in (0, 1) of the cubic with values g and slopes r at the ends, slope and curvature."""
    c2 = 3.0 * (g1 - g0) - 2.0 * r0 - r1
    c3 = 2.0 * (g0 - g1) + r0 + r1
    if g0 == 0.0:
        return 0.0, r0, 2.0 * c2
    low, high = 0.0, 1.0
    t = g0 / (g0 - g1)
    for _ in range(60):
        value = g0 + t * (r0 + t * (c2 + t * c3))
        slope = r0 + t * (2.0 * c2 + t * 3.0 * c3)
        if (value > 0.0) == (g1 > 0.0):
            high = t
        else:
            low = t
        step = -value / slope if slope != 0.0 else 2.0
        t += step
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(step) < 1e-13:
            break
    return t, r0 + t * (2.0 * c2 + t * 3.0 * c3), 2.0 * c2 + 6.0 * t * c3


@exact
def mend_crossing(A, dt, g0, r0, g1, r1, mend):
    """Impulse and displacement-times-mass that the scheme misses at a contact whose overlap went
    from g0 to g1 with rates r0, r1; also the rate at the crossing."""
    theta, slope, curvature = crossing(g0, dt * r0, g1, dt * r1)
    if (slope > 0.0) != (g1 > 0.0) or slope == 0.0:
        return 0.0, 0.0, 0.0
    closes = slope > 0.0
    z3, z5, z7 = zeta_sums(theta if closes else 1.0 - theta, mend[0], mend[1], mend[2])
    bend = 0.75 * curvature / abs(slope)
    bend = min(max(bend, -1.0), 1.0)
    size = A * dt * abs(slope) * math.sqrt(abs(slope))
    lever = 1.0 - theta
    impulse = -(z3 + bend * z5)
    moment = -(z5 + bend * z7)
    if closes:
        shift = lever * impulse - moment
    else:
        shift = lever * impulse + moment
    return size * impulse, dt * size * shift, slope / dt


@quick
def crossed(x, x_old, A, wall, wall_old, offset, plastic):
    """Did any contact open or close?"""
    n = x.size
    count = 0
    for i in range(n - 1):
        crater = 0.0 if plastic is None else plastic[1][CRATER, i]
        count += (x[i] - x[i + 1] > crater) != (x_old[i] - x_old[i + 1] > crater)
    if A.size == n:
        crater = 0.0 if plastic is None else plastic[1][CRATER, n - 1]
        before = x_old[n - 1] - wall_old[U] - wall_old[DASH] - offset
        after = x[n - 1] - wall[U] - wall[DASH] - offset
        count += (before > crater) != (after > crater)
    return count > 0


@exact
def passage(i, x, v, x_old, v_old, wall, wall_old, offset):
    """Overlap and its rate at contact i before and after the last step."""
    if i < x.size - 1:
        return (
            x_old[i] - x_old[i + 1], v_old[i] - v_old[i + 1], x[i] - x[i + 1], v[i] - v[i + 1],
        )  # fmt: skip
    return (
        x_old[i] - wall_old[U] - wall_old[DASH] - offset, v_old[i] - wall_old[V],
        x[i] - wall[U] - wall[DASH] - offset, v[i] - wall[V],
    )  # fmt: skip


@exact
def mend_crossings(
    dt, x, v, x_old, v_old, minv, A, wall, wall_old, ledger, offset, dissipation, square, modal,
    plastic, mend,
):  # fmt: skip
    """Add what the scheme missed at the contacts that opened or closed in the last step."""
    n = x.size
    for i in range(A.size):
        g0, r0, g1, r1 = passage(i, x, v, x_old, v_old, wall, wall_old, offset)
        coefficient = A[i]
        if plastic is not None:
            g0 -= plastic[1][CRATER, i]
            g1 -= plastic[1][CRATER, i]
            coefficient = plastic[1][COEFFICIENT, i]
        if (g0 > 0.0) == (g1 > 0.0):
            continue
        impulse, shift, rate = mend_crossing(coefficient, dt, g0, r0, g1, r1, mend)
        if dissipation is not None and dissipation[1] == HUNT_CROSSLEY:
            factor = max(dissipation[0][i] * rate, -1.0)
            ledger[0] += factor * impulse * rate
            impulse *= 1.0 + factor
            shift *= 1.0 + factor
        v[i] -= minv[i] * impulse
        x[i] -= minv[i] * shift
        if i < n - 1:
            v[i + 1] += minv[i + 1] * impulse
            x[i + 1] += minv[i + 1] * shift
        elif modal is not None:
            push_modes(impulse, square, wall, modal)
            wall[U] += square * shift
            q, _, phi, _, _ = modal
            for j in range(q.size):
                q[j] += phi[j] * shift


@exact
def yield_contacts(dt, x, v, x_old, v_old, A, wall, wall_old, ledger, offset, residual, plastic):
    """Deepen the craters of contacts that were pressed further than ever in the last step.

    Says whether any was.
    """
    history = plastic[1]
    deeper = False
    for i in range(A.size):
        g0, r0, g1, r1 = passage(i, x, v, x_old, v_old, wall, wall_old, offset)
        peak = max(g0, g1)
        if r0 > 0.0 and r1 < 0.0:
            r0 *= dt
            c2 = 3.0 * (g1 - g0) - 2.0 * r0 - r1 * dt
            c3 = 2.0 * (g0 - g1) + r0 + r1 * dt
            t = r0 / (math.sqrt(max(c2 * c2 - 3.0 * c3 * r0, 0.0)) - c2)
            peak = max(peak, g0 + t * (r0 + t * (c2 + t * c3)))
        if i == x.size - 1:
            peak = plastic_indentation(peak, A, residual, plastic)
        if peak > history[TOP, i]:
            before = plastic_loss(i, history[TOP, i], A, plastic)[0]
            loss, history[COEFFICIENT, i], history[CRATER, i] = plastic_loss(i, peak, A, plastic)
            history[TOP, i] = peak
            ledger[0] += loss - before
            deeper = True
    return deeper


# --- what is saved -----------------------------------------------------------------------------


@quick
def total_forces(x, v, f, A, wall, offset, residual, dissipation, plastic):
    """Contact forces at an instant, dissipative part included, into f; elastic energies out."""
    n = x.size
    contact = 0.0
    spring = 0.0
    for i in range(A.size):
        w = v[i] - (v[i + 1] if i < n - 1 else wall[V])
        gap = x[i] - (x[i + 1] if i < n - 1 else wall[U] + wall[DASH] + offset)
        s = None if residual is None else (0.0 if i < n - 1 else residual)
        if plastic is None:
            d = wall_indentation(gap, A[i], s)
            force = A[i] * d * math.sqrt(d)
        else:
            d = gap if i < n - 1 else plastic_indentation(gap, A, residual, plastic)
            force = plastic_force(i, d, A, plastic)
            d -= plastic[1][CRATER, i]
        contact += 0.4 * force * d
        if i == n - 1 and residual is not None:
            spring = 0.5 * residual * force * force
        if dissipation is not None:
            extra = damper(i, force, dissipation[0], dissipation[1]) * w
            if dissipation[1] != LINEAR:
                extra = max(extra, -force)
            force += extra
        f[i + 1] = force
    return contact, spring


@inner
def modal_energy(modal):
    """Energy of the modes about the static state, and in all."""
    q, p, _, omega, static = modal
    swing = 0.0
    absolute = 0.0
    for j in range(q.size):
        kinetic = 0.5 * p[j] ** 2
        stiffness = 0.5 * omega[j] ** 2
        swing += kinetic + stiffness * q[j] ** 2
        absolute += kinetic + stiffness * (q[j] + static[j]) ** 2
    return swing, absolute


@quick
def save(
    k, x, v, f, mass, A, wall, ledger, offset, residual, mobility, modal, dissipation,
    plastic, leaf_springs, preload, out,
):  # fmt: skip
    """Row k of the saved states, forces and energies."""
    xs, vs, fs, walls, energies = out
    contact, spring = total_forces(x, v, f, A, wall, offset, residual, dissipation, plastic)
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
    if modal is not None:
        swing, absolute = modal_energy(modal)
        energies[k, 3] = absolute
        energies[k, 6] += wall[WORK] - swing
    energies[k, 7] = preload * (x[-1] - xs[0, -1])
    total = -energies[k, 7]
    for e in range(7):
        total += energies[k, e]
    energies[k, 8] = total
    return abs(total) <= 1e300


# --- the explicit march ------------------------------------------------------------------------


@inner
def flow_bare(
    k, kick, drift, stale, x, v, A, f, minv, wall, ledger, offset, residual, mobility, modes
):  # fmt: skip
    """Forces, kick and drift of a chain without load, leaf springs, damping and yield."""
    if A.size == x.size and (stale or mobility is not None):
        f[x.size] = wall_force(x, kick, A, wall, ledger, offset, residual, mobility, None)
    if stale:
        kick_and_drift(kick, drift, x, v, A, f, minv)
    else:
        push_and_drift(kick, drift, x, v, f, minv)
    if modes is not None:
        modal, turn, square, rest_force = modes
        impulse = kick * (f[x.size] - rest_force)
        if drift == 0.0:
            push_modes(impulse, square, wall, modal)
        else:
            push_wall(impulse, square, wall)
            drift_modes(k, impulse, wall, modal, turn)


@inner
def push(
    kick, stale, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility, modes, plastic
):  # fmt: skip
    """Elastic kick; the force at the wall is taken anew where a dashpot creeps in it."""
    n = x.size
    if A.size == n and (stale or mobility is not None):
        f[n] = wall_force(x, kick, A, wall, ledger, offset, residual, mobility, plastic)
    push_spheres(v, kick, f, minv, load)
    if modes is not None:
        modal, _, square, rest_force = modes
        push_modes(kick * (f[n] - rest_force), square, wall, modal)


@inner
def kick_all(
    kick, stale, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility, modes,
    dissipation, plastic,
):  # fmt: skip
    """Kick, damping between two halves of the elastic one; forces anew where positions are."""
    if stale:
        sphere_forces(x, A, f, plastic)
    if dissipation is None:
        push(
            kick, stale, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility, modes,
            plastic,
        )  # fmt: skip
        return
    push(
        0.5 * kick, stale, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility, modes,
        plastic,
    )  # fmt: skip
    modal, square = None, 0.0
    if modes is not None:
        modal, _, square, _ = modes
    for first, share in ((0, 0.5), (1, 1.0), (0, 0.5)):
        damp_contacts(
            first, share * kick, v, f, minv, A.size, wall, ledger, dissipation, square, modal
        )
    push(
        0.5 * kick, False, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility, modes,
        plastic,
    )  # fmt: skip


@inner
def take_step(
    dt, stale, x, v, A, f, minv, a, b, load, leaf, wall, ledger, offset, residual, mobility,
    modes, dissipation, plastic,
):  # fmt: skip
    """Kick b[0], drift a[0], kick b[1], ..., kick b[-1]; are the forces stale at the end?"""
    for i in range(b.size):
        kick = b[i] * dt
        drift = a[i] * dt if i < a.size else 0.0
        if load is None and leaf is None and dissipation is None and plastic is None:
            if kick != 0.0:
                flow_bare(
                    i, kick, drift, stale, x, v, A, f, minv, wall, ledger, offset, residual,
                    mobility, modes,
                )  # fmt: skip
                stale = drift != 0.0
                continue
        if kick != 0.0:
            kick_all(
                kick, stale, x, v, A, f, minv, load, wall, ledger, offset, residual, mobility,
                modes, dissipation, plastic,
            )  # fmt: skip
            stale = False
        if drift != 0.0:
            drift_spheres(i, drift, x, v, leaf)
            if modes is not None:
                drift_modes(i, 0.0, wall, modes[0], modes[1])
            stale = True
    return stale


@njit(cache=True, error_model="numpy", nogil=True, fastmath=FAST)
def march(
    x, v, mass, A, a, b, dt, n_save, stride, load, leaf, leaf_springs, preload,
    offset, residual, mobility, modes, dissipation, plastic, mend, wall, out,
):  # fmt: skip
    """n_save times stride steps of kick b[0], drift a[0], kick b[1], ..., kick b[-1].

    The state is saved before and after each stride. Changes x, v, wall and the modes in place.
    Ends early, and says after how many saves, when a state is not finite.
    """
    f, saved_f = np.zeros(x.size + 1), np.zeros(x.size + 1)
    ledger = np.zeros(2)
    minv = 1.0 / mass
    x_old, v_old, wall_old = x.copy(), v.copy(), wall.copy()
    modal, square = None, 0.0
    if modes is not None:
        modal, _, square, _ = modes
    stale = True
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            if mend is not None or plastic is not None:
                x_old[:] = x
                v_old[:] = v
                wall_old[:] = wall
            stale = take_step(
                dt, stale, x, v, A, f, minv, a, b, load, leaf, wall, ledger, offset, residual,
                mobility, modes, dissipation, plastic,
            )  # fmt: skip
            if mend is not None and crossed(x, x_old, A, wall, wall_old, offset, plastic):
                mend_crossings(
                    dt, x, v, x_old, v_old, minv, A, wall, wall_old, ledger, offset, dissipation,
                    square, modal, plastic, mend,
                )  # fmt: skip
                stale = True
            if plastic is not None:
                stale |= yield_contacts(
                    dt, x, v, x_old, v_old, A, wall, wall_old, ledger, offset, residual, plastic
                )
        if not save(
            k, x, v, saved_f, mass, A, wall, ledger, offset, residual, mobility, modal,
            dissipation, plastic, leaf_springs, preload, out,
        ):  # fmt: skip
            return k
    return n_save


# --- the implicit march ------------------------------------------------------------------------


@exact_inner
def mean_hertz(d0, d1, A):
    """Mean force of a Hertz contact between the overlaps d0 and d1, change of potential over change
    of overlap, and its slope in d1; free of cancellation."""
    if d0 > 0.0 and d1 > 0.0:
        top = math.sqrt(max(d0, d1))
        y, z = math.sqrt(d0) / top, math.sqrt(d1) / top
        mean = 0.4 * A * top**3 * (z**4 + z**3 * y + z * z * y * y + z * y**3 + y**4) / (y + z)
        slope = 0.2 * A * top * (3.0 * z**3 + 6.0 * z * z * y + 4.0 * z * y * y + 2.0 * y**3)
        slope /= (y + z) ** 2
        return mean, slope
    if d1 > 0.0:
        force = A * d1 * math.sqrt(d1)
        mean = 0.4 * force * d1 / (d1 - d0)
        return mean, (force - mean) / (d1 - d0)
    if d0 > 0.0:
        mean = 0.4 * A * d0 * d0 * math.sqrt(d0) / (d0 - d1)
        return mean, mean / (d0 - d1)
    return 0.0, 0.0


@exact
def mean_series(g0, g1, A, residual):
    """`mean_hertz` of a Hertz contact and a spring in series, in terms of the gap of both."""
    d0, d1 = hertz_indentation(g0, A, residual), hertz_indentation(g1, A, residual)
    hertz, slope = mean_hertz(d0, d1, A)
    y, z = math.sqrt(d0), math.sqrt(d1)
    f0, f1 = A * d0 * y, A * d1 * z
    if d0 > 0.0 and d1 > 0.0:
        top = max(y, z)
        y, z = y / top, z / top
        secant = A * top * (z * z + z * y + y * y) / (y + z)
        stretch = 1.0 + residual * secant
        mean = (hertz + 0.5 * residual * (f0 + f1) * secant) / stretch
        return mean, slope / stretch
    if d0 <= 0.0 and d1 <= 0.0:
        return 0.0, 0.0
    stored = 0.4 * (f1 * d1 - f0 * d0) + 0.5 * residual * (f1 * f1 - f0 * f0)
    mean = stored / (g1 - g0)
    return mean, (f1 - mean) / (g1 - g0) if g1 > 0.0 else -mean / (g1 - g0)


@exact_inner
def mean_force(i, last, g0, g1, dt, A, residual, dissipation):
    """Mean total force of contact i over a step, its slope in g1, its elastic part."""
    if residual is not None and last:
        elastic, slope = mean_series(g0, g1, A[i], residual)
    else:
        elastic, slope = mean_hertz(g0, g1, A[i])
    if dissipation is None:
        return elastic, slope, elastic
    gamma, law, _ = dissipation
    if law == HUNT_CROSSLEY:
        factor = 1.0 + gamma[i] * (g1 - g0) / dt
        if factor <= 0.0:
            return 0.0, 0.0, elastic
        return elastic * factor, slope * factor + elastic * gamma[i] / dt, elastic
    force = elastic + gamma[i] * (max(g1, 0.0) - max(g0, 0.0)) / dt
    if law == LINEAR_CLIPPED and force <= 0.0:
        return 0.0, 0.0, elastic
    return force, slope + (gamma[i] / dt if g1 > 0.0 else 0.0), elastic


@exact
def largest(a, b):
    """Largest |a| or |a - b|."""
    most = 0.0
    for i in range(a.size):
        difference = a[i] if b is None else a[i] - b[i]
        most = max(most, abs(difference))
    return most


@exact_inner
def imbalance(dt, load, A, residual, dissipation, bodies, step):
    """Fill forces, slopes and r, what the equations of `implicit_step` miss at x1; sum r^2."""
    x0, x1, free, give = bodies
    f, elastic, slope, r = step[:4]
    n = x0.size - 1
    for i in range(A.size):
        f[i + 1], slope[i], elastic[i] = mean_force(
            i, i == n - 1, x0[i] - x0[i + 1], x1[i] - x1[i + 1], dt, A, residual, dissipation
        )
    square = 0.0
    for i in range(n + 1):
        net = f[i] - (f[i + 1] if i < n else 0.0)
        if load is not None:
            net += load[i]
        r[i] = free[i] + give[i] * net - x1[i]
        square += r[i] * r[i]
    return square


@exact_inner
def newton_change(give, n_contacts, step):
    """Solve the tangent system for r, in place."""
    _, _, slope, r, diagonal, upper, _ = step
    n = give.size - 1
    for i in range(n + 1):
        left = slope[i - 1] if 0 < i <= n_contacts else 0.0
        right = slope[i] if i < n_contacts else 0.0
        diagonal[i] = 1.0 + give[i] * (left + right)
        upper[i] = -give[i] * right
    for i in range(1, n + 1):
        below = -give[i] * (slope[i - 1] if i <= n_contacts else 0.0)
        factor = below / diagonal[i - 1]
        diagonal[i] -= factor * upper[i - 1]
        r[i] -= factor * r[i - 1]
    r[n] /= diagonal[n]
    for i in range(n - 1, -1, -1):
        r[i] = (r[i] - upper[i] * r[i + 1]) / diagonal[i]


@exact_inner
def implicit_step(dt, load, A, residual, dissipation, bodies, step):
    """Positions x1 (n + 1,) that the mean contact forces lead to, by Newton's method in O(n).

    Body i goes to free[i] + give[i] * (mean force on it); the last one is the wall. Each equation
    is one row of a tridiagonal, diagonally dominant matrix.
    """
    x0, x1, free, give = bodies
    r, change = step[3], step[6]
    for i in range(x1.size):
        x1[i] = free[i]
    norm = math.inf
    share = 1.0
    for _ in range(200):
        new_norm = imbalance(dt, load, A, residual, dissipation, bodies, step)
        if new_norm >= norm and share > 1e-9:
            share *= 0.5
            for i in range(x1.size):
                x1[i] -= share * change[i]
            if share * largest(change, None) > 1e-15 * largest(x1, x0):
                continue
            break
        if new_norm == 0.0 or share <= 1e-9:
            break
        norm = new_norm
        share = 1.0
        newton_change(give, A.size, step)
        for i in range(x1.size):
            change[i] = r[i]
            x1[i] += r[i]


@exact
def foresee_spheres(s, h, x, v, mass, leaf, bodies):
    """Where spheres go in the s-th part of a step without contact, and what a force adds."""
    x0, _, free, give = bodies
    for i in range(x.size):
        x0[i] = x[i]
        if leaf is None:
            free[i] = x[i] + h * v[i]
            give[i] = 0.5 * h * h / mass[i]
        else:
            rest, swing = leaf
            free[i] = rest[i] + swing[s, 0, i] * (x[i] - rest[i]) + swing[s, 1, i] * v[i]
            give[i] = swing[s, 3, i] / mass[i]


@exact
def foresee_wall(s, h, wall, offset, mobility, modes, bodies):
    x0, _, free, give = bodies
    n = x0.size - 1
    x0[n] = wall[U] + wall[DASH] + offset
    free[n], give[n] = x0[n], 0.0
    if modes is not None:
        (q, p, phi, _, _), turn, _, rest_force, reach = modes
        free[n] -= wall[U]
        for j in range(q.size):
            there = turn[s, 0, j] * q[j] + turn[s, 1, j] * p[j]
            free[n] += phi[j] * (there - reach[s, j] * phi[j] * rest_force)
            give[n] += phi[j] ** 2 * reach[s, j]
    if mobility is not None:
        give[n] += mobility * h


@exact
def carry_spheres(s, h, x, v, mass, load, leaf, bodies, f):
    """Positions and velocities at the end of the s-th part of a step."""
    x1 = bodies[1]
    for i in range(x.size):
        net = f[i] - f[i + 1]
        if load is not None:
            net += load[i]
        if leaf is None:
            v[i] += h * net / mass[i]
        else:
            rest, swing = leaf
            swung = swing[s, 2, i] * (x[i] - rest[i]) + swing[s, 0, i] * v[i]
            v[i] = swung + swing[s, 1, i] * net / mass[i]
        x[i] = x1[i]


@exact
def carry_wall(s, h, force, wall, ledger, mobility, modes):
    if modes is not None:
        (q, p, phi, _, _), turn, _, rest_force, reach = modes
        net = force - rest_force
        u = 0.0
        w = 0.0
        for j in range(q.size):
            here, speed, kick = q[j], p[j], phi[j] * net
            q[j] = turn[s, 0, j] * here + turn[s, 1, j] * speed + reach[s, j] * kick
            p[j] = turn[s, 2, j] * here + turn[s, 3, j] * speed + turn[s, 1, j] * kick
            u += phi[j] * q[j]
            w += phi[j] * p[j]
        wall[WORK] += net * (u - wall[U])
        wall[U], wall[V] = u, w
    if mobility is not None:
        wall[DASH] += mobility * h * force
        ledger[1] += mobility * h * force * force


@exact
def damping_work(bodies, f, elastic):
    """What the damping parts of the mean forces f take from the contacts."""
    x0, x1 = bodies[:2]
    lost = 0.0
    for i in range(elastic.size):
        change = (x1[i] - x1[i + 1]) - (x0[i] - x0[i + 1])
        lost += (f[i + 1] - elastic[i]) * change
    return lost


@njit(cache=True, error_model="numpy", nogil=True)
def march_implicit(
    x, v, mass, A, b, dt, n_save, stride, load, leaf, leaf_springs, preload, offset, residual,
    mobility, modes, dissipation, wall, out,
):  # fmt: skip
    """As `march`, by steps b[s] dt in which every contact acts with its mean force.

    Spheres and modes answer a constant force exactly, so energy is kept to rounding
    (discrete gradient of O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449, contact by contact).
    """
    n = x.size + 1
    x0, x1, free, give = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    f, elastic, slope, r = np.zeros(n), np.zeros(A.size), np.zeros(n), np.zeros(n)
    diagonal, upper, change = np.zeros(n), np.zeros(n), np.zeros(n)
    bodies = (x0, x1, free, give)
    step = (f, elastic, slope, r, diagonal, upper, change)
    saved_f, ledger = np.zeros(n), np.zeros(2)
    modal = None
    if modes is not None:
        modal = modes[0]
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            for s in range(b.size):
                h = b[s] * dt
                foresee_spheres(s, h, x, v, mass, leaf, bodies)
                foresee_wall(s, h, wall, offset, mobility, modes, bodies)
                implicit_step(h, load, A, residual, dissipation, bodies, step)
                ledger[0] += damping_work(bodies, f, elastic)
                carry_spheres(s, h, x, v, mass, load, leaf, bodies, f)
                carry_wall(s, h, f[x.size], wall, ledger, mobility, modes)
        if not save(
            k, x, v, saved_f, mass, A, wall, ledger, offset, residual, mobility, modal,
            dissipation, None, leaf_springs, preload, out,
        ):  # fmt: skip
            return k
    return n_save


# --- bare chains side by side ------------------------------------------------------------------


@quick
def forces_of_lanes(x, A, f):
    for j in range(A.size):
        d = x[j] - x[j + LANES]
        d = d if d > 0.0 else 0.0
        f[j + LANES] = A[j] * d * math.sqrt(d)


@quick
def push_modes_of_lanes(impulse, q, p, phi, shift):
    """p += phi impulse for every lane; with a shift, q += phi shift as well."""
    for j in range(0, q.size, LANES):
        for lane in range(LANES):
            p[j + lane] += phi[j + lane] * impulse[lane]
            if shift is not None:
                q[j + lane] += phi[j + lane] * shift[lane]


@quick
def read_modes_of_lanes(q, p, phi, u, w):
    u[:] = 0.0
    w[:] = 0.0
    for j in range(0, q.size, LANES):
        for lane in range(LANES):
            u[lane] += phi[j + lane] * q[j + lane]
            w[lane] += phi[j + lane] * p[j + lane]


@quick
def drift_modes_of_lanes(q, p, turn):
    for j in range(q.size):
        q_new = turn[0, j] * q[j] + turn[1, j] * p[j]
        p[j] = turn[2, j] * q[j] + turn[3, j] * p[j]
        q[j] = q_new


@quick
def crossed_row(x, x_old, row):
    count = 0.0
    for j in range(row, row + LANES):
        before = 1.0 if x_old[j] > x_old[j + LANES] else 0.0
        after = 1.0 if x[j] > x[j + LANES] else 0.0
        count += abs(after - before)
    return count > 0.0


@exact
def mend_lanes(dt, x, v, x_old, v_old, minv, A, mend, wall_impulse, wall_shift):
    """`mend_crossings` for lanes; what the wall's modes get is left in the last two arguments.

    Says whether there was any.
    """
    mended = False
    wall_impulse[:] = 0.0
    wall_shift[:] = 0.0
    for row in range(0, A.size, LANES):
        if not crossed_row(x, x_old, row):
            continue
        mended = True
        for j in range(row, row + LANES):
            k = j + LANES
            g0, g1 = x_old[j] - x_old[k], x[j] - x[k]
            if (g0 > 0.0) == (g1 > 0.0) or A[j] == 0.0:
                continue
            impulse, shift, _ = mend_crossing(
                A[j], dt, g0, v_old[j] - v_old[k], g1, v[j] - v[k], mend
            )
            v[j] -= minv[j] * impulse
            x[j] -= minv[j] * shift
            v[k] += minv[k] * impulse
            x[k] += minv[k] * shift
            if k >= A.size:
                wall_impulse[k - A.size] = impulse
                wall_shift[k - A.size] = shift
    return mended


@quick
def energy_of_lanes(x, v, mass, A, q, p, omega, energy):
    energy[:] = 0.0
    for row in range(0, A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            d = x[j] - x[j + LANES]
            d = d if d > 0.0 else 0.0
            energy[lane] += 0.4 * A[j] * d * d * math.sqrt(d) + 0.5 * mass[j] * v[j] * v[j]
    for row in range(0, q.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] += 0.5 * (p[j] * p[j] + omega[j] * omega[j] * q[j] * q[j])


@inner
def kick_lanes(kick, v, f, minv, q, p, phi, impulse):
    size = f.size - LANES
    for j in range(size):
        v[j] += kick * minv[j] * (f[j] - f[j + LANES])
    if q.size > 0:
        for lane in range(LANES):
            impulse[lane] = kick * f[size + lane]
        push_modes_of_lanes(impulse, q, p, phi, None)


@inner
def drift_lanes(drift, x, v, q, p, phi, turn):
    size = x.size - LANES
    for j in range(size):
        x[j] += drift * v[j]
    if q.size > 0:
        drift_modes_of_lanes(q, p, turn)
        read_modes_of_lanes(q, p, phi, x[size:], v[size:])


@inner
def step_of_lanes(dt, stale, a, b, x, v, f, minv, A, q, p, phi, turn, impulse):
    """`take_step` for lanes; are the forces stale at the end?"""
    for i in range(b.size):
        if b[i] != 0.0:
            if stale:
                forces_of_lanes(x, A, f)
            kick_lanes(b[i] * dt, v, f, minv, q, p, phi, impulse)
            stale = False
        if i < a.size and a[i] != 0.0:
            drift_lanes(a[i] * dt, x, v, q, p, phi, turn[i])
            stale = True
    return stale


@exact
def mend_step_of_lanes(dt, x, v, x_old, v_old, minv, A, q, p, phi, mend, impulse, shift):
    """Mend the contacts and push the modes by it; was there anything to mend?"""
    wall = slice(x.size - LANES, x.size)
    if q.size > 0:
        read_modes_of_lanes(q, p, phi, x[wall], v[wall])
    if not mend_lanes(dt, x, v, x_old, v_old, minv, A, mend, impulse, shift):
        return False
    if q.size > 0:
        push_modes_of_lanes(impulse, q, p, phi, shift)
        read_modes_of_lanes(q, p, phi, x[wall], v[wall])
    return True


@quick
def save_lanes(x, v, A, observed, energy, start, vs, wall_force, error):
    """Observed velocities vs (n_observed, lanes), wall force and worst energy error so far."""
    last = A.size - LANES
    for lane in range(LANES):
        for i in range(observed.size):
            vs[i, lane] = v[observed[i] * LANES + lane]
        d = max(x[last + lane] - x[last + LANES + lane], 0.0)
        wall_force[lane] = A[last + lane] * d * math.sqrt(d)
        change = abs(energy[lane] - start[lane]) / start[lane]
        if not change <= error[lane]:
            error[lane] = change


@njit(cache=True, error_model="numpy", nogil=True, fastmath=FAST)
def march_lanes(
    v0, mass, A, phi, omega, turn, a, b, dt, n_save, stride, observed, mend, vs, walls, errors
):
    """March LANES bare chains side by side, block after block.

    v0, mass, A (n_blocks, n), phi, omega (n_blocks, k), turn (n_blocks, n_drifts, 4,
    k * LANES). Fills vs (n_blocks, n_save + 1, n_observed), walls (n_blocks, n_save + 1,
    lanes) with the wall force and errors (n_blocks) with the energy error.
    """
    n_blocks, n = v0.shape[:2]
    size, modes = n * LANES, phi.shape[1] * LANES
    padded = size + LANES
    x, v, x_old, v_old = np.zeros(padded), np.zeros(padded), np.zeros(padded), np.zeros(padded)
    minv, f = np.zeros(padded), np.zeros(padded)
    impulse, shift, start, energy = np.zeros((4, LANES))
    for block in range(n_blocks):
        stiffness, inertia = A[block].reshape(size), mass[block].reshape(size)
        reading, swing = phi[block].reshape(modes), omega[block].reshape(modes)
        minv[:size] = 1.0 / inertia
        x[:], v[:size], v[size:] = 0.0, v0[block].reshape(size), 0.0
        q, p = np.zeros(modes), np.zeros(modes)
        stale = True
        for k in range(n_save + 1):
            for _step in range(stride if k > 0 else 0):
                if mend is not None:
                    x_old[:] = x
                    v_old[:] = v
                stale = step_of_lanes(
                    dt, stale, a, b, x, v, f, minv, stiffness, q, p, reading, turn[block], impulse
                )
                if mend is not None:
                    stale |= mend_step_of_lanes(
                        dt, x, v, x_old, v_old, minv, stiffness, q, p, reading, mend, impulse,
                        shift,
                    )  # fmt: skip
            energy_of_lanes(x, v, inertia, stiffness, q, p, swing, energy)
            if k == 0:
                start[:] = energy
            save_lanes(
                x, v, stiffness, observed, energy, start, vs[block, k], walls[block, k],
                errors[block],
            )  # fmt: skip
