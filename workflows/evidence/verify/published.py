"""Chains beside published figures; units m, A, V of the chain and t_s = (m/A)^(2/5) V^(-1/5)."""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import force_scale, time_scale
from dem.waves.arrivals import arrivals, passage
from workflows.evidence.verify.comparisons import Comparison, compared

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
    run = dem.march(unit_chain(60), None, struck(60), duration=70.0, dt=0.05, n_save=7000)
    yield from _wave(run)
    yield from _shares(run)
    recoil = [-0.07109, -0.03027, -0.01583, -0.00889, -0.00513]
    yield compared("recoil of spheres 1 to 5 [V]", run.v[-1, :5], recoil,
                   allowed=2e-5, of=1.0, source=NESTERENKO)  # fmt: skip
    yield from _faster()
    for ratio, share in ((0.5, 0.86492), (2.0, 0.96120), (5.0, 0.71353), (10.0, 0.48407)):
        name = f"energy of the leading wave, striker of mass {ratio:g}"
        yield compared(name, _leading_energy(ratio), share, allowed=2e-3, of=1.0, source=EXACT)


def _wave(run: dem.Trajectory) -> Iterator[Comparison]:
    t, v, F = run.t, run.v, run.contact_force
    one, two = (arrivals(t, v[:, i], threshold=0.5)[0] for i in (35, 50))
    speed, force = 15 / (two.time - one.time), F[:, 40].max()
    own = partial(compared, source=NESTERENKO)
    yield own("largest velocity [V]", one.peak_velocity, 0.68163, allowed=5e-5, of=1.0)
    yield own("wave speed [spheres/t_s]", speed, 0.84051, allowed=5e-5, of=1.0)
    discrete = speed / one.peak_velocity**0.2
    yield own("wave speed over v^0.2", discrete, 0.90747, allowed=5e-5, of=1.0)
    yield own("wave speed over v^0.2, of long waves", discrete, 0.91461, allowed=1e-2)
    yield own("peak force [F_s]", force, 0.63955, allowed=5e-5, of=1.0)
    yield own("peak force over v^1.2", force / one.peak_velocity**1.2, 1.01302, allowed=2e-4)
    width = arrivals(t, F[:, 40])[0].width * speed
    yield own("width of velocity [spheres]", one.width * speed, 1.579, allowed=2e-3, of=1.0)
    yield own("width of force [spheres]", width, 1.412, allowed=2e-3, of=1.0)
    a = 0.84051 * (t - arrivals(t, v[:, 40])[0].time)
    f = 2.39536 * a + 0.268529 * a**3 + 0.0061347 * a**5
    near, profile = np.abs(a) < 3.0, 0.5 * (1.0 + np.tanh(f / 2.0))
    yield compared("shape of the displacement", run.x[near, 40] / 1.35430, profile[near],
                   allowed=2.65e-4, of=1.0, source=SEN_MANCIU)  # fmt: skip
    yield own("displacement left behind [V t_s]", run.x[-1, 40], 1.35430, allowed=5e-5)


def _shares(run: dem.Trajectory) -> Iterator[Comparison]:
    own = partial(compared, source=NESTERENKO, of=1.0)
    k = np.searchsorted(run.t, 55.0)
    v, stored = run.v[k], 0.4 * run.contact_force[k] ** (5 / 3)
    energy = (0.5 * (v[30:] ** 2).sum() + stored[29:].sum()) / 0.5
    yield own("energy of the leading wave", energy, 0.99366, allowed=5e-5)
    yield own("momentum of the leading wave [m V]", v[30:].sum(), 1.13831, allowed=5e-5)
    passing = (run.t > 40.0) & (run.t < 40.0 + 15 / 0.84051)
    ratio = run.energy_contact[passing].mean() / run.energy_kinetic[passing].mean()
    # the recoiling spheres hold 0.0063 of the energy, all of it kinetic
    virial = 4 / 5 * (1 - 0.0063 / (5 / 9))
    yield own("potential over kinetic energy (4 : 5)", ratio, virial, allowed=2e-3)


def _faster() -> Iterator[Comparison]:
    """Powers by which force and wave speed grow with the striker's, exact of Hertz' law."""
    force, instant = np.empty((2, 2))
    for i, V in enumerate((1.0, 3.0)):
        run = dem.march(unit_chain(30), None, struck(30, V), duration=30.0, dt=0.01, n_save=6000)
        peak = arrivals(run.t, run.contact_force[:, 20])[0]
        force[i], instant[i] = peak.peak_velocity, peak.time
    own = partial(compared, source=NESTERENKO, of=1.0)
    powers = np.log([force[1] / force[0], instant[0] / instant[1]]) / np.log(3.0)
    yield own("peak force, power of V", powers[0], 1.2, allowed=1e-5)
    yield own("wave speed, power of V", powers[1], 0.2, allowed=1e-5)


def _leading_energy(ratio: float) -> float:
    """Share of the energy in the first wave of a chain struck by a sphere of another mass."""
    chain = unit_chain(60)
    chain.mass[0] = ratio
    run = dem.march(chain, None, struck(60), duration=55.0, dt=0.05, n_save=550)
    v, F = run.v[-1], run.contact_force[-1]
    gap = int(v.argmax()) - 1
    while F[gap] > 1e-3 * F.max() and F[gap] >= F[gap - 1]:
        gap -= 1
    return float(0.5 * (v[gap + 1 :] ** 2).sum() + 0.4 * (F[gap:] ** (5 / 3)).sum()) / (0.5 * ratio)


def contacts() -> Iterator[Comparison]:
    """One contact, two spheres, ten steel spheres."""
    yield from _one_on_a_flat()
    yield from _two_of_glass()
    published = [
        -0.071059, -0.030186, -0.015750, -0.008808, -0.005062,
        -0.002937, -0.001702, 0.002625, 0.146923, 0.985956,
    ]  # fmt: skip
    ten = dem.row_of_spheres(0.010, 7780.0, 203e9, 0.3, count=10, flat=None)
    run = dem.march(ten, None, struck(10), duration=5e-4, dt=2e-7, n_save=10)
    yield compared("ten steel spheres, final velocities [m/s]", run.v[-1], published,
                   allowed=1e-3, of=1.0, source=SICONOS)  # fmt: skip
    nine = dem.Chain(ten.mass[:9], ten.radius[:9], ten.A)
    run = dem.march(nine, dem.one_dof_wall(0.0, ten.mass[9]), struck(9), duration=5e-4, dt=2e-7)
    last = np.append(run.v[-1], run.wall_v[-1])
    yield compared("nine steel spheres and a free mass as wall, final velocities [m/s]", last,
                   published, allowed=1e-3, of=1.0, source=SICONOS)  # fmt: skip


def _one_on_a_flat() -> Iterator[Comparison]:
    chain = dem.Chain(np.array([2.0]), np.array([1.0]), np.array([5.0]))
    run = dem.march(
        chain, dem.rigid_wall(), struck(1, 0.3), duration=4.0, dt=2e-3, n_save=4000
    )  # fmt: skip
    T, F = 3.21807 * time_scale(2.0, 5.0, 0.3), 1.14326 * force_scale(2.0, 5.0, 0.3)
    own = partial(compared, source=HERTZ)
    yield own("sphere on a flat, duration [s]", _last(run), T, allowed=2e-3, of=1.0)
    yield own("sphere on a flat, force [N]", run.contact_force.max(), F, allowed=1e-5)


def _two_of_glass() -> Iterator[Comparison]:
    pair = dem.row_of_spheres(0.010, 2800.0, 48e9, 0.2, count=2, flat=None)
    v0 = np.array([10.0, -10.0])
    run = dem.march(pair, None, v0, duration=5e-5, dt=2e-8, n_save=2500)
    own = partial(compared, source=CHUNG_OOI)
    overlap = (run.x[:, 0] - run.x[:, 1]).max()
    yield own("glass spheres at 20 m/s, force [N]", run.contact_force.max(), 10.697e3, allowed=1e-4)
    yield own("glass spheres at 20 m/s, overlap [m]", overlap, 274.11e-6, allowed=1e-4)
    yield own("glass spheres at 20 m/s, duration [s]", _last(run), 40.34e-6, allowed=1e-3)


def _last(run: dem.Trajectory) -> float:
    """Instant of the last force at the first contact [s]."""
    return run.t[np.flatnonzero(run.contact_force[:, 0] > 0.0)[-1]]


class AtWall(NamedTuple):
    """Seventeen spheres at a wall: A_w / A, and what comes of a striker of speed 1."""

    factor: float
    force: tuple[float, float]  # its peak at the wall, and when
    at_14: tuple[float, float]  # the reflected wave's largest velocity, and when
    at_4: tuple[float, float]
    last: float  # velocity of sphere 1


SEVENTEEN = {
    "same material": AtWall(2**0.5, (1.24324, 20.6250), (0.64969, 24.8966), (0.83747, 37.1003),
                            -0.99256),
    "rigid": AtWall(2**1.5, (1.43158, 20.2776), (0.65665, 24.1637), (0.83492, 36.3673), -0.99247),
    "rigid, stiffness x 3": AtWall(3 * 2**1.5, (1.46293, 19.7917), (0.67927, 23.4955),
                                   (0.83243, 35.7023), -0.99218),
}  # fmt: skip
INCIDENT = 0.69865, 4.3296  # largest velocity of sphere 4, and when
CHAIN_PEAK = {"same material": 1.9439, "rigid": 2.2384}  # force at the wall over the wave's


def chain_and_wall() -> Iterator[Comparison]:
    """Seventeen spheres at a wall, columns that fall, a plate that carries energy away."""
    for wall, exact in SEVENTEEN.items():
        yield from _seventeen(wall, exact)
    yield from _of_the_rig()
    yield from _half_of_a_collision()
    yield from _columns()
    for inelasticity, e in ((0.1, 0.84334), (0.3, 0.60595), (0.5, 0.43690), (1.0, 0.18412)):
        name = f"restitution on a plate, inelasticity {inelasticity:g}"
        found = _restitution(inelasticity)
        yield compared(name, found, e, allowed=1e-5, of=1.0, source=ZENER)
    yield compared("restitution on a hinged plate, inelasticity 0.5", _on_modes(0.5), 0.43690,
                   allowed=1e-3, of=1.0, source=ZENER)  # fmt: skip


def _seventeen(wall: str, exact: AtWall) -> Iterator[Comparison]:
    chain = unit_chain(17, A_wall=exact.factor)
    run = dem.march(chain, dem.rigid_wall(), struck(17), duration=90.0, dt=0.03, n_save=9000)
    peak = arrivals(run.t, run.contact_force[:, -1])[0]
    back = [passage(run.t, run.v[:, i]).reflected for i in (13, 3)]
    own = partial(compared, source=EXACT, of=1.0, allowed=2e-4)
    yield own(f"{wall} wall, peak force [F_s]", peak.peak_velocity, exact.force[0])
    yield own(f"{wall} wall, instant of the peak [t_s]", peak.time, exact.force[1])
    far, near = exact.at_14, exact.at_4
    found = [-wave.peak_velocity for wave in back]
    yield own(f"{wall} wall, reflected at 14 and 4 [V]", found, [far[0], near[0]])
    found = [wave.time for wave in back]
    yield own(f"{wall} wall, instants of these [t_s]", found, [far[1], near[1]])
    yield own(f"{wall} wall, final velocity of 1 [V]", run.v[-1, 0], exact.last, allowed=2e-5)
    if wall in CHAIN_PEAK:
        long = dem.march(unit_chain(60), None, struck(60), duration=60.0, dt=0.05, n_save=6000)
        name = f"{wall} wall, peak force over that of the wave"
        yield own(name, peak.peak_velocity / long.contact_force[:, 40].max(), CHAIN_PEAK[wall])
    if wall == "rigid":
        passing = passage(run.t, run.v[:, 3]).incident
        found = [passing.peak_velocity, passing.time]
        yield own("wave on its way to the wall at 4 [V], [t_s]", found, INCIDENT)


def _of_the_rig() -> Iterator[Comparison]:
    """Sizes of the thesis' rig: spheres of 12.7 mm, a striker of 0.31 m/s."""
    R, V = 0.0127, 0.31
    own = partial(compared, allowed=2e-3, source=EXACT)
    for wall, flat, force in (("steel", dem.Flat(210e9, 0.3), 653.0),
                              ("rigid", dem.Flat(np.inf, 0.3), 752.0)):  # fmt: skip
        chain = dem.row_of_spheres(R, 7800.0, 210e9, 0.3, count=17, flat=flat)
        run = dem.march(
            chain, dem.rigid_wall(), struck(17, V), duration=1.2e-3, dt=1e-6, n_save=1200
        )  # fmt: skip
        yield own(f"rig, {wall} wall, peak force [N]", run.contact_force[:, -1].max(), force)
    waves = [arrivals(run.t, run.contact_force[:, i])[0] for i in (8, 12)]
    speed = 4 * 2 * R / (waves[1].time - waves[0].time)
    yield own("rig, force of the wave [N]", waves[1].peak_velocity, 336.0)
    yield own("rig, speed of the wave [m/s]", speed, 541.0)
    m, A = float(chain.mass[0]), float(chain.A[0])
    found = np.array([m, A, time_scale(m, A, V)]) / [66.9e-3, 1.226e10, 39.5e-6]
    yield own("rig, m, A and t_s over 66.9 g, 12.26 GN/m^1.5, 39.5 us", found, 1.0)


def _half_of_a_collision() -> Iterator[Comparison]:
    n, run = 9, {"duration": 25.0, "dt": 0.05, "n_save": 100}
    at_wall = dem.march(unit_chain(n, 2.0**1.5), dem.rigid_wall(), struck(n), **run)
    both = dem.march(unit_chain(2 * n), None, np.append(struck(n), -struck(n)[::-1]), **run)
    yield compared("nine at a rigid wall, nine against nine [V]", at_wall.v, both.v[:, :n],
                   allowed=1e-12, of=1.0, source=MIRROR)  # fmt: skip


def _columns() -> Iterator[Comparison]:
    n = np.array([1, 2, 5, 12])
    force, duration = np.transpose([_falling(count) for count in n])
    for count, times in zip(n[1:], force[1:] / force[0], strict=True):
        name = f"column of {count}, force over that of one"
        yield compared(name, times, 1.0240, allowed=5e-4, of=1.0, source=FALCON)
    line = np.polyval(np.polyfit(n, duration, 1), n)
    yield compared("columns of 1 to 12, duration beside a straight line [t_s]", duration, line,
                   allowed=1e-2, source=FALCON)  # fmt: skip


def _falling(n: int) -> tuple[float, float]:
    """Largest force at the wall, and how long a column of n touches it."""
    column, saves = unit_chain(n, 1.4), {"dt": 0.02, "n_save": 4000}
    run = dem.march(column, dem.rigid_wall(), np.ones(n), duration=4.0 * n + 1.0, **saves)
    touching = run.t[run.contact_force[:, -1] > 0.0]
    return run.contact_force[:, -1].max(), touching[-1] - touching[0]


def _restitution(inelasticity: float) -> float:
    return _rebound(dem.dashpot_wall(_impedance(inelasticity)), 12.0)


FALLEN = 0.0669, 1.7e10, 0.31  # m, A, v of what strikes a plate


def _impedance(inelasticity: float) -> float:
    """8 sqrt(D rho h) [N s/m]"""
    m, A, v = FALLEN
    return m**0.6 * A**0.4 * v**0.2 / inelasticity


def _rebound(wall: dem.Wall, times: float) -> float:
    m, A, v = FALLEN
    chain, t_s = dem.Chain(np.array([m]), np.array([0.0127]), np.array([A])), time_scale(m, A, v)
    run = dem.march(chain, wall, struck(1, v), duration=times * t_s, dt=t_s / 100)
    return -run.v[-1, 0] / v


def _on_modes(inelasticity: float, side: float = 0.6, line: float = 40.0) -> float:
    """Restitution in the middle of a square plate of `line` [kg/m^2], hinged, before a wave is
    back from its edges: omega = pi^2 (i^2 + j^2) / a^2 sqrt(D / rho h), i and j odd."""
    odd = np.arange(1.0, 400.0, 2.0)
    stiff = (_impedance(inelasticity) / 8) ** 2 / line  # D
    omega = np.sort((np.add.outer(odd**2, odd**2) * (np.pi / side) ** 2).ravel())
    omega *= np.sqrt(stiff / line)
    phi = np.full(omega.size, 2 / (side * line**0.5))
    lowest = omega < 2e6
    rest = float(np.sum((phi / omega)[~lowest] ** 2))
    return _rebound(dem.Wall(omega[lowest], np.zeros(lowest.sum()), phi[lowest], rest), 8.0)
