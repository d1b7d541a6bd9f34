"""Chains beside published figures; units m, A, V of the chain and t_s = (m/A)^(2/5) V^(-1/5)."""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import force_scale, time_scale
from beadwave.dem.waves.arrivals import arrivals, passage
from beadwave.workflows.evidence.harness import Comparison, compared

NESTERENKO = "V. F. Nesterenko, Dynamics of Heterogeneous Materials (2001), and exact runs of it"
SEN_MANCIU = "S. Sen, M. Manciu, Phys. Rev. E 64 (2001) 056605"
SICONOS = "Siconos tutorials, ChainOfBalls/MonodisperseChainOfBalls-LZBModel.ref"
CHUNG_OOI = "Y. C. Chung, J. Y. Ooi, Granular Matter 13 (2011) 643, test 1"
HERTZ = "H. Hertz (1882); K. L. Johnson, Contact Mechanics (1985), sec. 11.4"
FALCON = "E. Falcon, C. Laroche, S. Fauve, C. Coste, Eur. Phys. J. B 5 (1998) 111"
ZENER = "C. Zener, Phys. Rev. 59 (1941) 669"
EXACT = "an exact run by an independent integrator"
MIRROR = "the symmetry of a head-on collision"


def unit_chain(n: int, A_wall: float | None = None) -> dem.Chain:
    """Spheres of mass 1 and diameter 1, contacts of A = 1; at a wall where A_wall is given."""
    A = np.ones(n - 1 if A_wall is None else n)
    if A_wall is not None:
        A[-1] = A_wall
    return dem.Chain(np.ones(n), np.full(n, 0.5), A)


def struck(n: int, speed: float = 1.0) -> np.ndarray:
    """Velocities (n,) with only the striker moving."""
    return speed * np.eye(1, n)[0]


def solitary_wave() -> Iterator[Comparison]:
    """The wave in a chain of equal spheres: speed, force, shape, energy, recoil."""
    exact = partial(compared, source=NESTERENKO)
    run = dem.march(unit_chain(60), None, struck(60), duration=70.0, dt=0.05, n_save=7000)
    t, v, F = run.t, run.v, run.contact_force

    # speed and force, from the crests at spheres 36 and 51 and at the contact behind sphere 41
    first, second = (arrivals(t, v[:, i], threshold=0.5)[0] for i in (35, 50))
    speed, force = 15 / (second.time - first.time), F[:, 40].max()
    yield exact("largest velocity [V]", first.peak_velocity, 0.68163, allowed=5e-5, of=1.0)
    yield exact("wave speed [spheres/t_s]", speed, 0.84051, allowed=5e-5, of=1.0)
    discrete = speed / first.peak_velocity**0.2
    yield exact("wave speed over v^0.2", discrete, 0.90747, allowed=5e-5, of=1.0)
    yield exact("wave speed over v^0.2, of long waves", discrete, 0.91461, allowed=1e-2)
    yield exact("peak force [F_s]", force, 0.63955, allowed=5e-5, of=1.0)
    yield exact("peak force over v^1.2", force / first.peak_velocity**1.2, 1.01302, allowed=2e-4)

    # shape; Sen and Manciu's displacement is 1/2 (1 + tanh(f / 2)) of the final one
    width = arrivals(t, F[:, 40])[0].width * speed
    yield exact("width of velocity [spheres]", first.width * speed, 1.579, allowed=2e-3, of=1.0)
    yield exact("width of force [spheres]", width, 1.412, allowed=2e-3, of=1.0)
    a = 0.84051 * (t - arrivals(t, v[:, 40])[0].time)
    f = 2.39536 * a + 0.268529 * a**3 + 0.0061347 * a**5
    inside, profile = np.abs(a) < 3.0, 0.5 * (1.0 + np.tanh(f / 2.0))
    yield compared("shape of the displacement", run.x[inside, 40] / 1.35430, profile[inside],
                   allowed=2.65e-4, of=1.0, source=SEN_MANCIU)  # fmt: skip
    yield exact("displacement left behind [V t_s]", run.x[-1, 40], 1.35430, allowed=5e-5)

    # energy and momentum from sphere 31 on, once the wave has left the spheres before it
    k = np.searchsorted(t, 55.0)
    stored = 0.4 * F[k] ** (5 / 3)
    energy = (0.5 * (v[k, 30:] ** 2).sum() + stored[29:].sum()) / 0.5
    yield exact("energy of the leading wave", energy, 0.99366, allowed=5e-5, of=1.0)
    momentum = v[k, 30:].sum()
    yield exact("momentum of the leading wave [m V]", momentum, 1.13831, allowed=5e-5, of=1.0)
    passing = (t > 40.0) & (t < 40.0 + 15 / 0.84051)
    ratio = run.energy_contact[passing].mean() / run.energy_kinetic[passing].mean()
    # the virial theorem says 4 : 5; recoiling spheres hold 0.0063 of the energy, all of it kinetic
    virial = 4 / 5 * (1 - 0.0063 / (5 / 9))
    yield exact("potential over kinetic energy (4 : 5)", ratio, virial, allowed=2e-3, of=1.0)
    recoil = [-0.07109, -0.03027, -0.01583, -0.00889, -0.00513]
    yield exact("recoil of spheres 1 to 5 [V]", run.v[-1, :5], recoil, allowed=2e-5, of=1.0)

    # powers of the striker's speed, which Hertz' law gives exactly
    force, instant = np.empty((2, 2))
    for i, V in enumerate((1.0, 3.0)):
        run = dem.march(unit_chain(30), None, struck(30, V), duration=30.0, dt=0.01, n_save=6000)
        peak = arrivals(run.t, run.contact_force[:, 20])[0]
        force[i], instant[i] = peak.peak_velocity, peak.time
    powers = np.log([force[1] / force[0], instant[0] / instant[1]]) / np.log(3.0)
    yield exact("peak force, power of V", powers[0], 1.2, allowed=1e-5, of=1.0)
    yield exact("wave speed, power of V", powers[1], 0.2, allowed=1e-5, of=1.0)

    # a striker of another mass: the leading wave ends at the last gap, a minimum of the force
    for ratio, share in ((0.5, 0.86492), (2.0, 0.96120), (5.0, 0.71353), (10.0, 0.48407)):
        chain = unit_chain(60)
        chain.mass[0] = ratio
        run = dem.march(chain, None, struck(60), duration=55.0, dt=0.05, n_save=550)
        v, F = run.v[-1], run.contact_force[-1]
        gap = int(v.argmax()) - 1
        while F[gap] > 1e-3 * F.max() and F[gap] >= F[gap - 1]:
            gap -= 1
        energy = 0.5 * (v[gap + 1 :] ** 2).sum() + 0.4 * (F[gap:] ** (5 / 3)).sum()
        yield compared(f"energy of the leading wave, striker of mass {ratio:g}",
                       float(energy) / (0.5 * ratio), share,
                       allowed=2e-3, of=1.0, source=EXACT)  # fmt: skip


def contacts() -> Iterator[Comparison]:
    """One contact, two spheres, ten steel spheres."""
    # a sphere on a flat: duration 3.21807 t_s, largest force 1.14326 F_s
    chain = dem.Chain(np.array([2.0]), np.array([1.0]), np.array([5.0]))
    v0, run_for = struck(1, 0.3), {"duration": 4.0, "dt": 2e-3, "n_save": 4000}
    run = dem.march(chain, dem.rigid_wall(), v0, **run_for)
    T, F = 3.21807 * time_scale(2.0, 5.0, 0.3), 1.14326 * force_scale(2.0, 5.0, 0.3)
    hertz = partial(compared, source=HERTZ)
    yield hertz("sphere on a flat, duration [s]", _end_of_contact(run), T, allowed=2e-3, of=1.0)
    yield hertz("sphere on a flat, force [N]", run.contact_force.max(), F, allowed=1e-5)

    # two glass spheres that meet at 20 m/s
    pair = dem.row_of_spheres(0.010, 2800.0, 48e9, 0.2, count=2, flat=None)
    v0 = np.array([10.0, -10.0])
    run = dem.march(pair, None, v0, duration=5e-5, dt=2e-8, n_save=2500)
    F, overlap = run.contact_force.max(), (run.x[:, 0] - run.x[:, 1]).max()
    published = partial(compared, source=CHUNG_OOI)
    yield published("glass spheres at 20 m/s, force [N]", F, 10.697e3, allowed=1e-4)
    yield published("glass spheres at 20 m/s, overlap [m]", overlap, 274.11e-6, allowed=1e-4)
    yield published(
        "glass spheres at 20 m/s, duration [s]", _end_of_contact(run), 40.34e-6, allowed=1e-3
    )

    # ten steel spheres, and nine of them before a free mass in the place of the tenth
    velocities = [
        -0.071059, -0.030186, -0.015750, -0.008808, -0.005062,
        -0.002937, -0.001702, 0.002625, 0.146923, 0.985956,
    ]  # fmt: skip
    ten = dem.row_of_spheres(0.010, 7780.0, 203e9, 0.3, count=10, flat=None)
    run = dem.march(ten, None, struck(10), duration=5e-4, dt=2e-7, n_save=10)
    yield compared("ten steel spheres, final velocities [m/s]", run.v[-1], velocities,
                   allowed=1e-3, of=1.0, source=SICONOS)  # fmt: skip
    nine = dem.Chain(ten.mass[:9], ten.radius[:9], ten.A)
    run = dem.march(nine, dem.one_dof_wall(0.0, ten.mass[9]), struck(9), duration=5e-4, dt=2e-7)
    yield compared("nine steel spheres and a free mass as wall, final velocities [m/s]",
                   np.append(run.v[-1], run.wall_v[-1]), velocities,
                   allowed=1e-3, of=1.0, source=SICONOS)  # fmt: skip


def _end_of_contact(run: dem.Trajectory) -> float:
    """Instant of the last force at the first contact [s]."""
    return run.t[np.flatnonzero(run.contact_force[:, 0] > 0.0)[-1]]


class AtWall(NamedTuple):
    """Seventeen spheres at a wall: A_w / A, and what comes of a striker of speed 1."""

    factor: float  # A_w / A
    force: tuple[float, float]  # peak at the wall [F_s], its instant [t_s]
    at_14: tuple[float, float]  # largest velocity of the reflected wave [V], its instant [t_s]
    at_4: tuple[float, float]  # the same at sphere 4
    v_1: float  # final velocity of sphere 1 [V]


SEVENTEEN = {
    "same material": AtWall(2**0.5, (1.24324, 20.6250), (0.64969, 24.8966), (0.83747, 37.1003),
                            -0.99256),
    "rigid": AtWall(2**1.5, (1.43158, 20.2776), (0.65665, 24.1637), (0.83492, 36.3673), -0.99247),
    "rigid, stiffness x 3": AtWall(3 * 2**1.5, (1.46293, 19.7917), (0.67927, 23.4955),
                                   (0.83243, 35.7023), -0.99218),
}  # fmt: skip
INCIDENT = 0.69865, 4.3296  # largest velocity of sphere 4 [V] on the way to the wall, when [t_s]
CHAIN_PEAK = {"same material": 1.9439, "rigid": 2.2384}  # force at the wall over the wave's


def chain_and_wall() -> Iterator[Comparison]:
    """Seventeen spheres at a wall, columns that fall, a plate that carries energy away."""
    for wall, truth in SEVENTEEN.items():
        chain = unit_chain(17, A_wall=truth.factor)
        run = dem.march(chain, dem.rigid_wall(), struck(17), duration=90.0, dt=0.03, n_save=9000)
        peak = arrivals(run.t, run.contact_force[:, -1])[0]
        reflected = [passage(run.t, run.v[:, i]).reflected for i in (13, 3)]
        exact = partial(compared, source=EXACT, of=1.0, allowed=2e-4)
        yield exact(f"{wall} wall, peak force [F_s]", peak.peak_velocity, truth.force[0])
        yield exact(f"{wall} wall, instant of the peak [t_s]", peak.time, truth.force[1])
        velocities, instants = zip(truth.at_14, truth.at_4, strict=True)
        yield exact(f"{wall} wall, reflected at 14 and 4 [V]",
                    [-wave.peak_velocity for wave in reflected], velocities)  # fmt: skip
        yield exact(f"{wall} wall, instants of these [t_s]",
                    [wave.time for wave in reflected], instants)  # fmt: skip
        yield exact(f"{wall} wall, final velocity of 1 [V]", run.v[-1, 0], truth.v_1, allowed=2e-5)
        if wall in CHAIN_PEAK:
            long = dem.march(unit_chain(60), None, struck(60), duration=60.0, dt=0.05, n_save=6000)
            yield exact(f"{wall} wall, peak force over that of the wave",
                        peak.peak_velocity / long.contact_force[:, 40].max(),
                        CHAIN_PEAK[wall])  # fmt: skip
        if wall == "rigid":
            incident = passage(run.t, run.v[:, 3]).incident
            yield exact("wave on its way to the wall at 4 [V], [t_s]",
                        [incident.peak_velocity, incident.time], INCIDENT)  # fmt: skip

    # sizes of the thesis' rig: spheres of 12.7 mm, a striker of 0.31 m/s
    R, V = 0.0127, 0.31
    exact = partial(compared, allowed=2e-3, source=EXACT)
    for wall, flat, force in (("steel", dem.Flat(210e9, 0.3), 653.0),
                              ("rigid", dem.Flat(np.inf, 0.3), 752.0)):  # fmt: skip
        chain = dem.row_of_spheres(R, 7800.0, 210e9, 0.3, count=17, flat=flat)
        run = dem.march(
            chain, dem.rigid_wall(), struck(17, V), duration=1.2e-3, dt=1e-6, n_save=1200
        )  # fmt: skip
        yield exact(f"rig, {wall} wall, peak force [N]", run.contact_force[:, -1].max(), force)
    first, second = (arrivals(run.t, run.contact_force[:, i])[0] for i in (8, 12))
    speed = 4 * 2 * R / (second.time - first.time)
    yield exact("rig, force of the wave [N]", second.peak_velocity, 336.0)
    yield exact("rig, speed of the wave [m/s]", speed, 541.0)
    m, A = float(chain.mass[0]), float(chain.A[0])
    scales = np.array([m, A, time_scale(m, A, V)]) / [66.9e-3, 1.226e10, 39.5e-6]
    yield exact("rig, m, A and t_s over 66.9 g, 12.26 GN/m^1.5, 39.5 us", scales, 1.0)

    # a rigid wall is half of a head-on collision: A_w = 2^1.5 A
    n, run_for = 9, {"duration": 25.0, "dt": 0.05, "n_save": 100}
    at_wall = dem.march(unit_chain(n, 2.0**1.5), dem.rigid_wall(), struck(n), **run_for)
    two_rows = np.append(struck(n), -struck(n)[::-1])
    collision = dem.march(unit_chain(2 * n), None, two_rows, **run_for)
    yield compared("nine at a rigid wall, nine against nine [V]", at_wall.v, collision.v[:, :n],
                   allowed=1e-12, of=1.0, source=MIRROR)  # fmt: skip

    # falling columns: the force does not grow with their length, the contact lasts in proportion
    n, peaks, durations = np.array([1, 2, 5, 12]), [], []
    for count in n:
        column, run_for = unit_chain(count, 1.4), {"duration": 4.0 * count + 1.0, "dt": 0.02}
        run = dem.march(column, dem.rigid_wall(), np.ones(count), **run_for, n_save=4000)
        touching = run.t[run.contact_force[:, -1] > 0.0]
        peaks.append(run.contact_force[:, -1].max())
        durations.append(touching[-1] - touching[0])
    for count, peak in zip(n[1:], peaks[1:], strict=True):
        yield compared(f"column of {count}, force over that of one", peak / peaks[0], 1.0240,
                       allowed=5e-4, of=1.0, source=FALCON)  # fmt: skip
    line = np.polyval(np.polyfit(n, durations, 1), n)
    yield compared("columns of 1 to 12, duration beside a straight line [t_s]", durations, line,
                   allowed=1e-2, source=FALCON)  # fmt: skip

    # a large plate is a dashpot of 8 sqrt(D rho h); Zener's inelasticity is the one parameter
    for inelasticity, e in ((0.1, 0.84334), (0.3, 0.60595), (0.5, 0.43690), (1.0, 0.18412)):
        plate = dem.dashpot_wall(_plate_impedance(inelasticity))
        yield compared(f"restitution on a plate, inelasticity {inelasticity:g}",
                       _restitution(plate, 12.0), e,
                       allowed=1e-5, of=1.0, source=ZENER)  # fmt: skip

    # the same as modes of a hinged square plate, struck in its middle, before a wave is back from
    # its edges: omega = pi^2 (i^2 + j^2) / a^2 sqrt(D / rho h), i and j odd
    side, rho_h = 0.6, 40.0  # m, kg/m^2
    odd = np.arange(1.0, 400.0, 2.0)
    D = (_plate_impedance(0.5) / 8) ** 2 / rho_h
    omega = np.sort((np.add.outer(odd**2, odd**2) * (np.pi / side) ** 2).ravel())
    omega *= np.sqrt(D / rho_h)
    phi = np.full(omega.size, 2 / (side * rho_h**0.5))
    lowest = omega < 2e6  # higher ones answer statically
    residual = float(np.sum((phi / omega)[~lowest] ** 2))
    plate = dem.Wall(omega[lowest], np.zeros(lowest.sum()), phi[lowest], residual)
    yield compared("restitution on a hinged plate, inelasticity 0.5", _restitution(plate, 8.0),
                   0.43690, allowed=1e-3, of=1.0, source=ZENER)  # fmt: skip


FALLEN = 0.0669, 1.7e10, 0.31  # m [kg], A [N/m^1.5], v [m/s] of the sphere that strikes a plate


def _plate_impedance(inelasticity: float) -> float:
    """8 sqrt(D rho h) [N s/m] of the plate on which FALLEN has this inelasticity."""
    m, A, v = FALLEN
    return m**0.6 * A**0.4 * v**0.2 / inelasticity


def _restitution(wall: dem.Wall, duration: float) -> float:
    """Speed of FALLEN after this many t_s over the speed before."""
    m, A, v = FALLEN
    chain, t_s = dem.Chain(np.array([m]), np.array([0.0127]), np.array([A])), time_scale(m, A, v)
    run = dem.march(chain, wall, struck(1, v), duration=duration * t_s, dt=t_s / 100)
    return -run.v[-1, 0] / v
