"""Tangential force of a contact of spheres under any history: a row of independent springs.

    spring at x, |x| < a = sqrt(R d):   normal  E* (d - x^2/R) dx,   tangential  G* u(x) dx
    du = dU, the relative tangential motion, as long as  |u| <= q c (d - x^2/R),   c = mu E* / G*

beyond, u slips along that bound; out of contact u = 0. q is the total pressure over the elastic
one, 1 + gamma d' of Hunt and Crossley's damping and 1 without. The row is the exact solution for
axisymmetric bodies under the assumptions of Cattaneo and Mindlin (V. L. Popov, M. Hess, Method of
Dimensionality Reduction in Contact Mechanics and Friction, Springer 2015, chap. 5; J. Jaeger, Arch.
Appl. Mech. 65 (1995) 478; M. Ciavarella, Int. J. Solids Struct. 35 (1998) 2349).

In one direction u stays linear in pieces over xi = x^2, in which the bound is a line, and a move
with dU/dd constant is exact at any length. In two directions u is a vector at the ends of equal
cells in xi. While it slips it stays on the circle of the bound and turns towards the move: from an
angle theta to it by d theta = -(|dU| / b) sin theta, so that along a straight move in which b
changes linearly

    tan(theta/2) falls by  exp(-|dU| integral ds/b)

in closed form (R. D. Krieg, D. B. Krieg, J. Press. Vessel Technol. 99 (1977) 510, whose b is
constant): marches are of order 2 in two directions too. A return along the radius of the circle
would leave order 1.

A piece between x1 and x2 is a parabola in x: Simpson's rule is its force in closed form, and three
points of Gauss' rule are exact for its energy and for what it loses by slip.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import ieee, ieee_entry
from beadwave.dem.kernels.numbers import larger, smaller

# of `SpringRow.state` and `SpringCells.state`: overlap and q at the end of the last move, heat of
# friction so far, share of the contact's area that did not slip in the last move, largest bound in
# the middle, changes of the force by merges, sum of their sizes; width of a cell in xi
OVERLAP, PRESSURE, HEAT, STICK, TOP, MERGED, WIDTH = range(7)
GAUSS = 0.5 * math.sqrt(0.6)  # the outer points of Gauss' rule, from the middle of the interval


class TangentialLaw(NamedTuple):
    """Law of a contact's tangential springs."""

    modulus: float  # G* [Pa]
    bound: float  # c = mu E* / G*: the displacement that slips, over the overlap of the spring
    radius: float  # [m] relative
    # of the largest bound: nodes that lie closer to a line are merged, once half of the room is
    # full; doubled until they fit. The room decides more: 1e-8 to 1e-5 differ by up to 2.4 times
    tolerance: float = 1e-6


class SpringRow(NamedTuple):
    """Displacement u of the springs over xi = x^2, linear between nodes, 0 at the edge."""

    xi: Array  # (capacity,) [m^2], from 0 to the contact's edge R d
    u: Array  # (capacity,) [m]
    count: NDArray[np.int64]  # (1,) nodes; 0 while the contact is open
    state: Array  # (7,)


class SpringCells(NamedTuple):
    """Displacements of the springs in two directions at the ends of equal cells in xi."""

    u: Array  # (n_cells + 1, 2) [m]; 0 outside of the contact
    state: Array  # (7,)


@ieee_entry
def slide(row: SpringRow, room: SpringRow, law: TangentialLaw, d: float, q: float, way: float):
    """Move the contact to the overlap d [m] while its bodies shift by `way` [m]; friction's heat
    [J] of it, never negative. Changes `row`; `room` is as large, its content does not matter.

    Overlap and shift are proportional over the move. A spring whose trial displacement
    t = u + dU ends beyond the bound b by e > 0 has slipped e, along a bound that was on average
    b - db e / 2 r; db is the bound's change over the move and r = |dU| - db the rate of slip.
    """
    R, c = law.radius, law.bound
    xi, u, state, n = row.xi, row.u, row.state, row.count[0]
    d0, q0 = state[OVERLAP], state[PRESSURE]
    edge0, edge = R * larger(d0, 0.0), R * larger(d, 0.0)
    heat, sticking, m, last_side = 0.0, 0.0, 0, 0

    # pieces between the nodes, those cut by a receding edge in two, and that of springs that enter
    for k in range(n if edge <= edge0 else larger(n, 1)):
        for half in range(2):
            if k < n - 1:
                cut = smaller(larger(edge, xi[k]), xi[k + 1])
                xi1, xi2 = (xi[k], cut) if half == 0 else (cut, xi[k + 1])
            else:
                xi1, xi2 = edge0, edge if half == 0 else edge0
            if not xi1 < xi2:
                continue

            # trial displacement and bound at both ends of the piece; springs that leave move on
            # until the edge passes them, where their bound is 0 and all of their shear slips
            leaves = half == 1
            if k < n - 1:
                slope = (u[k + 1] - u[k]) / (xi[k + 1] - xi[k])
                t1, t2 = u[k] + slope * (xi1 - xi[k]), u[k] + slope * (xi2 - xi[k])
                if leaves:  # for a share of the move
                    t1 += way * (edge0 - xi1) / (R * (d0 - d))
                    t2 += way * (edge0 - xi2) / (R * (d0 - d))
                else:
                    t1 += way
                    t2 += way
            else:
                t1, t2 = way * (edge - edge0) / (R * (d - d0)), 0.0
            b1 = 0.0 if leaves else q * c * larger(d - xi1 / R, 0.0)
            b2 = 0.0 if leaves else q * c * larger(d - xi2 / R, 0.0)

            # where in the piece slip begins or ends, towards + and towards -
            z1, z2 = 1.0, 1.0
            if (t1 > b1) != (t2 > b2):
                z1 = (t1 - b1) / (t1 - b1 - (t2 - b2))
            if (-t1 > b1) != (-t2 > b2):
                z2 = (t1 + b1) / (t1 + b1 - (t2 + b2))
            z1, z2 = smaller(z1, z2), larger(z1, z2)

            start = 0.0
            for end in (z1, z2, 1.0):
                if end <= start and m > 0:
                    continue
                middle = 0.5 * (start + end)
                t, b = t1 + middle * (t2 - t1), b1 + middle * (b2 - b1)

                # slip towards + or -, judged in the middle; its heat by Gauss' rule over x
                side = 1.0 if t > b else -1.0 if -t > b else 0.0
                x1, x2 = math.sqrt(xi1 + start * (xi2 - xi1)), math.sqrt(xi1 + end * (xi2 - xi1))
                if side != 0.0:
                    for g in range(-1, 2):
                        x = 0.5 * (x1 + x2) + g * GAUSS * (x2 - x1)
                        z = (x * x - xi1) / (xi2 - xi1)
                        b = b1 + z * (b2 - b1)
                        slip = larger(side * (t1 + z * (t2 - t1)) - b, 0.0)
                        db = c * (q * (d - x * x / R) - q0 * (d0 - x * x / R))
                        rate = larger(side * way - db, slip)
                        if slip > 0.0:
                            mean = larger(b - 0.5 * db * slip / rate, 0.0)
                            weight = (8.0 if g == 0 else 5.0) / 9.0  # times 2, over a length of 2
                            heat += law.modulus * weight * (x2 - x1) * slip * mean
                if leaves:
                    start = end
                    continue
                if side == 0.0:
                    sticking += x2 * x2 - x1 * x1

                # a node at the end of what slips one way, or at every node of what sticks
                if m == 0:
                    room.xi[0] = 0.0
                    room.u[0] = smaller(larger(t1, -b1), b1)
                    m = 1
                elif side != 0.0 and side == last_side:
                    m -= 1
                t, b = t1 + end * (t2 - t1), b1 + end * (b2 - b1)
                xi3 = xi1 + end * (xi2 - xi1)
                if xi3 > room.xi[m - 1]:  # a crossing may coincide with a node to rounding
                    if side == 0.0 and m > 1 and room.u[m - 2] == room.u[m - 1] == t:
                        m -= 1  # springs that have not moved
                    room.xi[m], room.u[m] = xi3, smaller(larger(t, -b), b)
                    m, last_side = m + 1, side
                start = end
    if m > 0:
        room.xi[m - 1], room.u[m - 1] = edge, 0.0

    # a move at most doubles the nodes: beyond half of the room those on a line are merged
    state[TOP] = larger(state[TOP] if d0 > 0.0 else 0.0, q * c * d)
    tolerance = law.tolerance * state[TOP]
    while m > xi.size // 2 - 2:
        m, change = merge(room, m, tolerance)
        state[MERGED] += law.modulus * change
        tolerance *= 2.0
    for j in range(m):
        xi[j], u[j] = room.xi[j], room.u[j]
    row.count[0] = m
    state[OVERLAP], state[PRESSURE] = d, q
    state[HEAT] += heat
    state[STICK] = sticking / edge if m > 0 else 0.0
    return heat


@ieee
def merge(row: SpringRow, n: int, tolerance: float) -> tuple[int, float]:
    """Leave out nodes of the first n, as many in a row as lie within the tolerance [m] of a line;
    how many stay, and the sum of the sizes by which forces over 2 G* x [m^2] change."""
    xi, u = row.xi, row.u
    m, first, change = 1, 0, 0.0
    while first < n - 1:
        last = first + 1
        close = True
        while close and last + 1 < n:
            slope = (u[last + 1] - u[first]) / (xi[last + 1] - xi[first])
            for j in range(first + 1, last + 1):
                close = close and abs(u[first] + slope * (xi[j] - xi[first]) - u[j]) <= tolerance
            if close:
                last += 1
        pieces = 0.0
        for j in range(first, last):
            pieces += integral(xi[j], xi[j + 1], u[j], u[j + 1])
        change += abs(integral(xi[first], xi[last], u[first], u[last]) - pieces)
        xi[m], u[m] = xi[last], u[last]
        m, first = m + 1, last
    return m, change


@ieee
def integral(xi1: float, xi2: float, u1: float, u2: float) -> float:
    """Integral of 2 u dx [m^2] over sqrt(xi1) < x < sqrt(xi2), of u linear in xi: a parabola in x,
    which Simpson's rule takes exactly, without the cancellation of differences of powers."""
    x1, x2 = math.sqrt(xi1), math.sqrt(xi2)
    h = x2 - x1
    at_middle = (2.0 * x1 + 0.5 * h) / (2.0 * (2.0 * x1 + h)) if h > 0.0 else 0.5
    return h / 3.0 * (u1 + u2 + 4.0 * (u1 + at_middle * (u2 - u1)))


@ieee_entry
def tangential_force(row: SpringRow, law: TangentialLaw) -> float:
    """Force [N] of the springs against the motion of the body that moved by U.

    The sum of G* [2 alpha sqrt(xi) + 2/3 beta xi^(3/2)] over the pieces u = alpha + beta xi.
    """
    force = 0.0
    for j in range(row.count[0] - 1):
        force += integral(row.xi[j], row.xi[j + 1], row.u[j], row.u[j + 1])
    return law.modulus * force


@ieee_entry
def stored_energy(row: SpringRow, law: TangentialLaw) -> float:
    """Energy [J] in the springs, the integral of G* u^2 / 2 over -a < x < a."""
    energy = 0.0
    for j in range(row.count[0] - 1):
        x1, x2 = math.sqrt(row.xi[j]), math.sqrt(row.xi[j + 1])
        for g in range(-1, 2):
            x = 0.5 * (x1 + x2) + g * GAUSS * (x2 - x1)
            z = (x * x - row.xi[j]) / (row.xi[j + 1] - row.xi[j])
            u = row.u[j] + z * (row.u[j + 1] - row.u[j])
            energy += (8.0 if g == 0 else 5.0) / 18.0 * (x2 - x1) * u * u
    return law.modulus * energy


# --- two directions -------------------------------------------------------------------------------


@ieee
def turned(
    u1: float, u2: float, b0: float, b: float, way1: float, way2: float
) -> tuple[float, float, float]:
    """Displacement [m] of a spring after a straight move, while its bound changes linearly from b0
    to b [m], and friction's heat over G* [m^2]; see the head of the module.

    |u| less the bound is convex along the way, and the rate of slip grows while u turns towards it:
    a spring that ends beyond the bound slips from one point of the move to its end.
    """
    t1, t2 = u1 + way1, u2 + way2
    if t1 * t1 + t2 * t2 <= b * b:
        return t1, t2, 0.0

    # where it begins to slip: |u + s way| = b0 + s db
    way, db = math.sqrt(way1 * way1 + way2 * way2), b - b0
    square = way * way - db * db
    half = u1 * way1 + u2 * way2 - b0 * db
    inside = smaller(u1 * u1 + u2 * u2 - b0 * b0, 0.0)
    root = math.sqrt(larger(half * half - square * inside, 0.0))
    begin = 0.0
    if half > 0.0:
        begin = -inside / (half + root)
    elif square > 0.0:
        begin = (root - half) / square
    begin = smaller(larger(begin, 0.0), 1.0)
    u1, u2, rest = u1 + begin * way1, u2 + begin * way2, 1.0 - begin
    bound, size = b0 + begin * db, math.sqrt(u1 * u1 + u2 * u2)
    if way == 0.0:  # the bound shrinks
        return u1 * b / size, u2 * b / size, rest * -db * 0.5 * (bound + b)

    # cosine and sine of the angle to the move, and of half of it but for a factor
    e1, e2 = way1 / way, way2 / way
    along, across = 1.0, 0.0
    if size > 0.0:
        along, across = (u1 * e1 + u2 * e2) / size, (u2 * e1 - u1 * e2) / size
    C, S = (1.0 + along, across) if along > 0.0 else (across, 1.0 - along)
    if across != 0.0:
        if bound > 0.0 and b > 0.0:
            growth = (b - bound) / bound
            spent = rest / bound if growth == 0.0 else rest / bound * math.log1p(growth) / growth
            S *= math.exp(-way * spent)
        else:
            S = 0.0
    norm = C * C + S * S
    after = (C * C - S * S) / norm if norm > 0.0 else along
    turn = 2.0 * C * S / norm if norm > 0.0 else across
    lost = 0.5 * rest * (bound * larger(way * along - db, 0.0) + b * larger(way * after - db, 0.0))
    return b * (after * e1 - turn * e2), b * (after * e2 + turn * e1), lost


@ieee_entry
def slide_cells(
    cells: SpringCells, law: TangentialLaw, d: float, q: float, way1: float, way2: float
) -> float:
    """`slide` by (way1, way2) [m] in two directions, to the overlap d [m] and the pressure ratio q;
    friction's heat [J] of it, never negative. Changes the cells.

    Cells double in width where the contact outgrows them, so that a contact that grows from nothing
    is always divided into half of them at least. The wave that announces itself through a chain at
    rest presses by 1e-320 m first, of which a cell's width would round to zero and never grow.
    """
    R, c, u, state = law.radius, law.bound, cells.u, cells.state
    n = u.shape[0] - 1
    d0, q0 = state[OVERLAP], state[PRESSURE]
    edge0, edge = R * larger(d0, 0.0), R * larger(d, 0.0)
    if edge0 == 0.0:
        state[WIDTH] = 1.5 * larger(edge, 1e-300) / n
    while edge > n * state[WIDTH]:
        state[WIDTH] *= 2.0
        for k in range(n + 1):
            for j in range(2):
                u[k, j] = u[2 * k, j] if 2 * k <= n else 0.0

    width = state[WIDTH]
    heat, before, sticking = 0.0, 0.0, 0.0
    for k in range(n + 1):
        xi = k * width
        if xi >= larger(edge0, edge):
            break

        # share of the move during which the spring is in contact, and its bound then
        share = 1.0
        if xi >= edge0:
            share = (edge - xi) / (R * (d - d0))
        elif xi >= edge:
            share = (edge0 - xi) / (R * (d0 - d))
        b0, b = q0 * c * larger(d0 - xi / R, 0.0), q * c * larger(d - xi / R, 0.0)
        t1, t2, lost = turned(u[k, 0], u[k, 1], b0, b, share * way1, share * way2)
        if lost == 0.0 and xi < edge:
            sticking += smaller(width, edge - xi)
        u[k, 0], u[k, 1] = t1, t2
        if before != 0.0 or lost != 0.0:
            heat += integral(larger(xi - width, 0.0), xi, before, lost)
        before = lost
    # what lies between the last of the cells' ends and the edge
    outer = larger(edge0, edge)
    inner = math.floor(outer / width) * width if width > 0.0 else 0.0
    if inner < outer:
        heat += integral(inner, outer, before, 0.0)
    heat *= law.modulus
    state[OVERLAP], state[PRESSURE] = d, q
    state[HEAT] += heat
    state[STICK] = sticking / edge if edge > 0.0 else 0.0
    return heat


@ieee
def cells_within(cells: SpringCells, law: TangentialLaw) -> int:
    """Springs from the first on that are in contact."""
    edge, width = law.radius * cells.state[OVERLAP], cells.state[WIDTH]
    return min(math.ceil(edge / width), cells.u.shape[0]) if edge > 0.0 else 0


@ieee
def copy_cells(cells: SpringCells, to: SpringCells, law: TangentialLaw) -> None:
    """The cells into others of as many; springs out of contact are at 0, in both."""
    for j in range(max(cells_within(cells, law), cells_within(to, law))):
        to.u[j, 0], to.u[j, 1] = cells.u[j, 0], cells.u[j, 1]
    for j in range(cells.state.size):
        to.state[j] = cells.state[j]


@ieee_entry
def cell_force(cells: SpringCells, law: TangentialLaw) -> tuple[float, float]:
    """`tangential_force` of the cells in both directions [N]: `integral` of each cell, with one
    root of xi a cell."""
    u, width = cells.u, cells.state[WIDTH]
    edge = law.radius * larger(cells.state[OVERLAP], 0.0)
    force1, force2, x1 = 0.0, 0.0, 0.0
    for k in range(u.shape[0]):
        xi = k * width
        if xi >= edge:
            break
        whole = xi + width < edge and k + 1 < u.shape[0]
        x2 = math.sqrt(xi + width if whole else edge)
        h = x2 - x1
        at_middle = (2.0 * x1 + 0.5 * h) / (2.0 * (x1 + x2))
        here, there = h / 3.0 * (5.0 - 4.0 * at_middle), h / 3.0 * (1.0 + 4.0 * at_middle)
        force1 += here * u[k, 0]
        force2 += here * u[k, 1]
        if whole:
            force1 += there * u[k + 1, 0]
            force2 += there * u[k + 1, 1]
        x1 = x2
    return law.modulus * force1, law.modulus * force2


@ieee_entry
def cell_energy(cells: SpringCells, law: TangentialLaw) -> float:
    """`stored_energy` of the cells [J]."""
    u, width = cells.u, cells.state[WIDTH]
    edge = law.radius * larger(cells.state[OVERLAP], 0.0)
    energy = 0.0
    for k in range(u.shape[0]):
        xi = k * width
        if xi >= edge:
            break
        whole = xi + width < edge and k + 1 < u.shape[0]
        end = xi + width if whole else edge
        x1, x2 = math.sqrt(xi), math.sqrt(end)
        for g in range(-1, 2):
            x = 0.5 * (x1 + x2) + g * GAUSS * (x2 - x1)
            z = (x * x - xi) / (end - xi)
            for j in range(2):
                after = u[k + 1, j] if whole else 0.0
                value = u[k, j] + z * (after - u[k, j])
                energy += (8.0 if g == 0 else 5.0) / 18.0 * (x2 - x1) * value * value
    return law.modulus * energy
