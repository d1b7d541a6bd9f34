"""Forces and energies of a state: what is saved.

    kinetic + contacts + leaf springs + modes + residual spring + losses - works  =  constant

A contact holds the integral of its force, 2/5 F d of Hertz' law; the modes' losses are the work
done on them less what they hold. A sum that drifts shows an error of the march; one that stays does
not show that the model is right: a wall of a wrong participation conserves energy too.
"""

from beadwave.dem.kernels.arguments import (
    DASH,
    IN_CONTACTS,
    IN_GUIDES,
    IN_WALL,
    WORK,
    Array,
    ChainArrays,
    Damping,
    ForceShape,
    LeafSprings,
    Motion,
    Plastic,
    SavedStates,
    U,
    V,
    WallModes,
)
from beadwave.dem.kernels.compiled import fastmath_inline
from beadwave.dem.kernels.laws import (
    STOPPED,
    damper,
    elastic_force,
    never_pulls,
    plastic_force,
    plastic_indentation,
    stored_energy,
    wall_indentation,
)
from beadwave.dem.kernels.modes import modal_energy
from beadwave.dem.kernels.numbers import larger, smaller


@fastmath_inline
def total_forces(
    dt: float, motion: Motion, chain: ChainArrays, shape: ForceShape | None, residual: float | None,
    damping: Damping | None, plastic: Plastic | None,
) -> tuple[float, float]:  # fmt: skip
    """Contact forces [N] at an instant, dissipative part included, into `motion.f`; elastic
    energies [J] of the contacts and of the residual spring.

    A damper counts no stronger than steps of dt [s] can tell: beyond, its force is that of
    rounding.
    """
    x, v, wall, A = motion.x, motion.v, motion.wall, chain.A
    n = x.size
    contact = 0.0
    spring = 0.0
    for i in range(A.size):
        w = v[i] - (v[i + 1] if i < n - 1 else wall[V])
        gap = x[i] - (x[i + 1] if i < n - 1 else wall[U] + wall[DASH] + chain.offset)
        if plastic is None:
            d = larger(gap, 0.0) if i < n - 1 else wall_indentation(i, gap, A, residual, shape)
            force = elastic_force(i, d, A, shape)
            contact += stored_energy(i, d, force, A, shape)
        else:
            d = gap if i < n - 1 else plastic_indentation(i, gap, A, residual, plastic)
            force = plastic_force(i, d, A, plastic)
            contact += 0.4 * force * (d - plastic.crater[i])
        if i == n - 1 and residual is not None:
            spring = 0.5 * residual * force * force
        if damping is not None:
            c = damper(i, i == n - 1, force, A, shape, residual, damping, plastic)
            extra = w * smaller(c, STOPPED / (dt * damping.inverse_mass[i]))
            if never_pulls(damping.law):
                extra = larger(extra, -force)
            force += extra
        motion.f[i + 1] = force
    return contact, spring


@fastmath_inline
def leaf_energy(x: Array, leaf: LeafSprings | None) -> float:
    """sum k (x - anchor)^2 / 2 [J] of spheres at x (n,) [m]; 0 without leaf springs."""
    energy = 0.0
    if leaf is not None:
        for i in range(x.size):
            energy += 0.5 * leaf.stiffness[i] * (x[i] - leaf.anchor[i]) ** 2
    return energy


@fastmath_inline
def weight_work(x: Array, start: Array, weight: Array) -> float:
    """Work [J] of the weights (n,) [N] on the way from `start` to x, (n,) [m] each."""
    work = 0.0
    for i in range(x.size):
        work += weight[i] * (x[i] - start[i])
    return work


@fastmath_inline
def save_modes(row: Array, speeds: Array, modes: WallModes | None) -> None:
    """Displacements of the modes, the static ones included, into row (n_modes,) [kg^1/2 m], and
    their rates into speeds (n_modes,); a row that is (0,) takes none."""
    if modes is not None:
        for j in range(row.size):
            row[j] = modes.q[j] + modes.static[j]
        for j in range(speeds.size):
            speeds[j] = modes.p[j]


@fastmath_inline
def save(
    k: int,
    dt: float,
    motion: Motion,
    chain: ChainArrays,
    saved: SavedStates,
    mobility: float | None,
) -> bool:
    """Row k of the saved states, forces and energies; is it finite? dt [s] of the steps."""
    x, v, wall, energy = motion.x, motion.v, motion.wall, saved.energy[k]
    contact, spring = total_forces(
        dt, motion, chain, chain.shape, chain.residual, chain.damping, chain.plastic
    )

    # states; the wall's velocity is that of its modes and of the dashpot under the force
    for i in range(x.size):
        saved.x[k, i] = x[i]
        saved.v[k, i] = v[i]
    kinetic = 0.0  # in a loop that writes nothing: else its order follows where the arrays lie
    for i in range(x.size):
        kinetic += 0.5 * chain.mass[i] * v[i] ** 2
    for i in range(chain.A.size):
        saved.force[k, i] = motion.f[i + 1]
    save_modes(saved.modes[k], saved.speeds[k], chain.modes)
    swing, absolute = modal_energy(chain.modes)
    saved.wall[k, 0] = wall[U] + wall[DASH] + chain.offset
    saved.wall[k, 1] = wall[V]
    if mobility is not None:
        saved.wall[k, 1] += mobility * motion.f[x.size]

    # energies in the order of `Trajectory`: what is held, what is lost, works of steady forces
    energy[0] = kinetic
    energy[1] = contact
    energy[2] = leaf_energy(x, chain.leaf)
    energy[3] = absolute
    energy[4] = spring
    energy[5] = motion.ledger[IN_CONTACTS]
    energy[6] = motion.ledger[IN_WALL] + (wall[WORK] - swing)
    energy[7] = motion.ledger[IN_GUIDES]
    energy[8] = chain.preload * (x[-1] - saved.x[0, -1])
    energy[9] = weight_work(x, saved.x[0], chain.weight)
    total = -energy[8]
    for e in range(8):
        total += energy[e]
    total -= energy[9]
    energy[10] = total
    return abs(total) <= 1e300  # not so of inf or NaN, which parts that are not finite leave
