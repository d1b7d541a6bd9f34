"""Stiffness of a bolted joint by formula: bolt, members, foot, slip.

Members are pressed between head and nut in cones of a half angle alpha. A frustum of modulus E and
thickness t that begins with the diameter D around a hole of diameter d has the stiffness

    k = pi E d tan(alpha) / ln((s + D - d) (D + d) / ((s + D + d) (D - d))),   s = 2 t tan(alpha),

and k_m is that of all frusta in series, from both ends to the middle of the grip. The bolt is its
shank and the thread in the grip in series, k_b; both resist the opening of the joint together:

    k_z = k_b + k_m.

Shigley's Mechanical Engineering Design, 10th ed. (2015), eq. 8-17 and 8-20, with alpha = 30 degrees
and D = 1.5 d; Wileman, Choudhury and Green, J. Mech. Des. 113 (1991) 432.

The mesh of the bodies holds most of this elasticity already: a joint holds the disc of radius a of
each face that the cone has reached, its foot, and between two such discs bodies give by
c_mesh (`disc_compliance`). Springs have what is left,

    1 / k_spring = 1 / k - c_mesh + lambda / F,

the last term of rough faces (`rough_layer`). It is an even layer under the foot, so that
k_rx = k_ry = k_z a^2 / 4 and k_rz = k_x a^2 / 2. Along the faces a foot that sticks gives in the
mesh alone. After slip the bolt carries the shear, by Huth's formula (ASTM STP 927 (1986) 221).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.joints import Bushing
from beadwave.fem.assembly.materials import Material

CONE = np.deg2rad(30.0)  # half angle of the cones
CONES = np.deg2rad([25.0, 33.0])  # within which Shigley, sec. 8-5, has those of joints
BEARING = 1.5  # diameter of the face under the head over that of the bolt, Shigley
WILEMAN = (0.78715, 0.62873)  # A and B of steel
STEEL = (190e9, 220e9)  # [Pa] moduli that count as steel's
HUTH = (2 / 3, 3.0)  # exponent and factor of bolted metal
# of a joint's compliance, that its springs have at least: a foot whose mesh holds all of it is
# nearly rigid, and its stiffness can still be tuned
LEAST_SHARE = 0.05
PERSSON = 0.4  # lambda over the rms height; Persson, Phys. Rev. Lett. 99 (2007) 125502


class Bolt(NamedTuple):
    """A bolt with its nut, and one washer under it."""

    diameter: float  # [m] of the shank
    pitch: float  # [m]
    stress_area: float  # [m^2] of the thread
    bearing: float  # [m] diameter of the face under the head
    head_height: float  # [m]
    across_flats: float  # [m]
    nut_height: float  # [m]
    washer: tuple[float, float]  # [m] outer diameter and thickness; 0 without one
    proof_stress: float  # [Pa]
    young: float  # [Pa]
    density: float  # [kg/m^3]
    length_step: float  # [m] of the lengths that are sold
    # [m] of the thread of bolts up to the length of the second number, and of longer ones
    thread: tuple[float, float, float]

    @property
    def proof_load(self) -> float:
        """[N]"""
        return self.proof_stress * self.stress_area

    def length(self, grip: float) -> float:
        """[m] of the shortest bolt that is sold and ends two threads beyond its nut."""
        least = grip + self.washer[1] + self.nut_height + 2 * self.pitch
        return float(np.ceil(least / self.length_step - 1e-9) * self.length_step)


class Member(NamedTuple):
    """A body between head and nut."""

    thickness: float  # [m] along the bolt
    material: Material
    hole: float  # [m] diameter


class PressedFaces(NamedTuple):
    """Two faces that a bolt presses on each other, and the discs of them that a model holds."""

    after: int  # the member before them, from the head
    friction: float
    rms: float = 0.0  # [m] of the heights of both together; 0 has no rough layer
    held: float = 0.0  # [m] radius of the discs that is asked for; it is that of the foot at least
    room: float = np.inf  # [m] to which the foot can spread
    couplings: tuple[str, str] = ("rigid", "mean")


class Fastener(NamedTuple):
    """The part of a bolt that moves with one face: its mass, and moments of inertia about axes
    across it (2) and along it."""

    mass: float  # [kg]
    inertia: tuple[float, float, float]  # [kg m^2]
    height: float  # [m] of its centre of mass over the end of the grip; below 0 in the hole


class JointStiffness(NamedTuple):
    """Springs of a joint between two of the members, with their spreads and reasons.

    Springs are along and about x, y in the faces and z along the bolt, as `fem.Bushing`. A
    deviation is that of ln(value).
    """

    bolt: float  # [N/m]
    members: float  # [N/m] by Shigley's cones
    wileman: float | None  # [N/m]; None of members of several materials
    held: float  # [m] radius of the discs held: the foot's, or more
    total: float  # [N/m] along z, the mesh's share included
    mesh: float  # [m/N] of the mesh between the discs held
    springs: Bushing
    deviation: NDArray[np.float64]  # (6,)
    slipped: Bushing  # after slip
    slip_load: float  # [N]


def frustum(E: float, d: float, t: float, D: float, alpha: float = CONE) -> float:
    """Stiffness [N/m] of a frustum of thickness t [m] from the diameter D around a hole d."""
    spread = 2 * t * np.tan(alpha)
    ratio = (spread + D - d) * (D + d) / ((spread + D + d) * (D - d))
    return float(np.pi * E * d * np.tan(alpha) / np.log(ratio))


def members_stiffness(members: Sequence[Member], d: float, D: float, alpha: float = CONE) -> float:
    """k_m [N/m] of members from head to nut, of a bolt of diameter d with bearing faces D."""
    ends = np.cumsum([0.0, *(member.thickness for member in members)])
    grip, compliance = ends[-1], 0.0
    for member, first, last in zip(members, ends, ends[1:], strict=False):
        # cones from both ends meet half-way; a member beyond the middle is two frusta
        for low, high in ((first, min(last, grip / 2)), (grip - last, min(grip - first, grip / 2))):
            if high - low > 1e-12 * grip:
                at = D + 2 * low * np.tan(alpha)
                compliance += 1 / frustum(member.material.young, d, high - low, at, alpha)
    return 1 / compliance


def wileman_stiffness(members: Sequence[Member], d: float) -> float | None:
    """k_m [N/m] = E d A exp(B d / l) of steel members; None of others."""
    moduli = [member.material.young for member in members]
    if not all(STEEL[0] <= E <= STEEL[1] for E in moduli) or np.ptp(moduli) > 1e-3 * moduli[0]:
        return None
    A, B = WILEMAN
    return float(moduli[0] * d * A * np.exp(B * d / sum(m.thickness for m in members)))


def bolt_stiffness(bolt: Bolt, grip: float) -> float:
    """k_b [N/m] = A_d A_t E / (A_d l_t + A_t l_d), Shigley eq. 8-17: shank l_d and thread l_t of
    the grip in series."""
    length, (thread, up_to, longer) = bolt.length(grip), bolt.thread
    shank = float(np.clip(length - (thread if length <= up_to else longer), 0.0, grip))
    A_d, A_t = np.pi / 4 * bolt.diameter**2, bolt.stress_area
    return bolt.young / (shank / A_d + (grip - shank) / A_t)


def huth_stiffness(first: Member, second: Member, bolt: Bolt) -> float:
    """Shear stiffness [N/m] of a bolt in single shear between two members."""
    a, b = HUTH
    t, E = (first.thickness, second.thickness), (first.material.young, second.material.young)
    f = ((t[0] + t[1]) / (2 * bolt.diameter)) ** a * b
    f *= sum(1 / (x * y) + 1 / (2 * x * bolt.young) for x, y in zip(t, E, strict=True))
    return 1 / f


def disc_compliance(a: float, material: Material, coupling: str) -> float:
    """Displacement over force [m/N], along the normal, of a disc of radius a on a half-space: held
    rigidly, or the mean under an even pressure. Johnson, Contact Mechanics (1985), sec. 3.4, 3.6.
    """
    share = 1 / 2 if coupling == "rigid" else 16 / (3 * np.pi**2)
    return share * (1 - material.poisson**2) / (material.young * a)


def rocking_difference(member: Member, a: float, b: float) -> float:
    """Turn over moment [rad/(N m)] about an axis in the face by which a disc of radius a, held
    rigidly, gives more than one of radius b: 3 (1 - nu^2) / (4 E a^3) on a half-space (Johnson
    (1985), sec. 5.3), and 3 (1 - nu^2) / (pi E t^3) ln(b / a) in the bending of a plate beyond it
    (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells (1959), sec. 63)."""
    E, nu, t = member.material.young, member.material.poisson, member.thickness
    half_space = 0.75 * (a**-3 - b**-3)
    return (1 - nu**2) / E * (half_space + 3 / (np.pi * t**3) * np.log(b / a))


def tangential_share(first: Material, second: Material) -> float:
    """Stiffness along over that across a contact, 2 (1 - nu) / (2 - nu) of equal materials; Johnson
    (1985), sec. 7.2."""
    normal, along = (
        sum((f(m.poisson)) * 2 * (1 + m.poisson) / m.young for m in (first, second))
        for f in (lambda nu: (1 - nu) / 2, lambda nu: (2 - nu) / 4)
    )
    return normal / along


def rough_layer(rms: float) -> tuple[float, float]:
    """lambda [m] of rough faces, k_n = p / lambda, and its deviation of ln: 0.4 of the rms height
    of both faces; numbers of Persson and of Yang and Persson (2008) lie within a factor of 2."""
    return PERSSON * rms, 0.5 * np.log(2.0)


def joint_stiffness_by_formula(
    bolt: Bolt, members: Sequence[Member], faces: PressedFaces, preload: float
) -> JointStiffness:
    """The joint at a pair of faces of members, which are counted from the head, under a preload
    [N]."""
    d, D, (first, second) = bolt.diameter, bolt.bearing, members[faces.after : faces.after + 2]
    before = sum(m.thickness for m in members[: faces.after + 1])
    grip = sum(m.thickness for m in members)

    def foot(alpha: float) -> float:
        """Radius that the cone has reached at the interface."""
        return float(min(D / 2 + min(before, grip - before) * np.tan(alpha), faces.room))

    # of a stack each interface has an equal share of the compliance
    k_b, k_m = bolt_stiffness(bolt, grip), members_stiffness(members, d, D)
    wileman = wileman_stiffness(members, d)
    c = 1 / (k_b + k_m) / (len(members) - 1)
    narrow, wide = (members_stiffness(members, d, D, alpha) for alpha in CONES)
    spread = np.log(wide / narrow) / 2
    if wileman is not None:
        spread = np.hypot(spread, np.log(wileman / k_m))

    # at the foot: less what the mesh has between its discs, along the faces nearly nothing
    a, held = foot(CONE), max(foot(CONE), faces.held)
    pressed = (first, second)
    layer, layer_spread = rough_layer(faces.rms)
    rough = layer / preload
    along = tangential_share(first.material, second.material)

    def of_mesh(radius: float) -> float:
        """Compliance [m/N] of the mesh between discs of a radius."""
        return sum(
            disc_compliance(radius, member.material, coupling)
            for member, coupling in zip(pressed, faces.couplings, strict=True)
        )

    c_z = max(c - of_mesh(a), LEAST_SHARE * c) + rough
    c_x = (LEAST_SHARE * c + rough) / along
    c_r, c_t = 4 * c_z / a**2, 2 * c_x / a**2

    # wider discs than the foot: what these take from the mesh
    c_z += of_mesh(a) - of_mesh(held)
    c_x += (of_mesh(a) - of_mesh(held)) / along
    c_r += sum(rocking_difference(member, a, held) for member in pressed)
    c_t += sum(3 / (16 * m.material.lame[1]) * (a**-3 - held**-3) for m in pressed)
    springs = Bushing(*(1 / np.array([c_x, c_x, c_z, c_r, c_r, c_t])).tolist())
    after = min(huth_stiffness(first, second, bolt), springs.kx / 2)
    slipped = springs._replace(kx=after, ky=after, krz=min(after * a**2 / 2, springs.krz))

    # deviations: along z of the cone's angle, in the formula and in the disc that it leaves; of
    # turns besides in the rocking of these; in the plane slip is two deviations away
    spread_a = np.log(foot(CONES[1]) / foot(CONES[0])) / 2
    sigma_z = np.sqrt(
        (spread * c) ** 2 + (spread_a * of_mesh(a)) ** 2 + (layer_spread * rough) ** 2
    )
    sigma_r = sum(rocking_difference(m, a, a * np.exp(spread_a)) for m in pressed)
    s_z = deviation_of_ln(sigma_z / c_z)
    s_r = deviation_of_ln(np.hypot(4 * sigma_z / a**2, sigma_r) / c_r)
    s_x = np.log(springs.kx / after) / 2
    return JointStiffness(
        k_b, k_m, wileman, held, 1 / (c + rough), of_mesh(held), springs,
        np.array([s_x, s_x, s_z, s_r, s_r, s_x]), slipped, faces.friction * preload,
    )  # fmt: skip


def deviation_of_ln(relative: float) -> float:
    """Deviation of ln(k) from the relative deviation v of a compliance: v up to 1, 1 + ln v beyond,
    with the same slope at 1. Of thin plates, whose mesh has nearly all of the compliance, v is in
    the hundreds, and exp(v) spans more decades than any joint does."""
    return float(relative if relative <= 1.0 else 1.0 + np.log(relative))


def fastener_masses(bolt: Bolt, grip: float) -> tuple[Fastener, Fastener]:
    """Head with half of the shank in the grip, and nut, washer and the rest of the bolt.

    Hexagons of the same area as cylinders, threads of their stress area.
    """
    rho, L = bolt.density, bolt.length(grip)
    hexagon = np.sqrt(3) / 2 * bolt.across_flats**2
    hole, core = np.pi / 4 * bolt.diameter**2, bolt.stress_area
    outer, thickness = bolt.washer
    ends = []
    for parts in (
        ((hexagon, bolt.head_height, 0.0), (hole, grip / 2, -grip / 2)),
        (
            (max(np.pi / 4 * outer**2 - hole, 0.0), thickness, 0.0),
            (hexagon - hole, bolt.nut_height, thickness),
            (core, L - grip, 0.0),
            (core, grip / 2, -grip / 2),
        ),
    ):
        # (area, height, lower end) of cylinders on one axis
        A, h, low = np.array(parts).T
        m, z = rho * A * h, low + h / 2
        centre = m @ z / m.sum()
        across = m @ (A / (4 * np.pi) + h**2 / 12 + (z - centre) ** 2)
        axial = m @ (A / (2 * np.pi))
        ends.append(Fastener(float(m.sum()), (float(across), float(across), float(axial)), centre))
    return ends[0], ends[1]
