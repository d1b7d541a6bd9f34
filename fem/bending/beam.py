"""Timoshenko's beam by finite elements of high order on its middle line.

    2 V = int E I theta'^2 + kappa G A (w' - theta)^2 + N w'^2 dx
    2 T = int rho A w_t^2 + rho I theta_t^2 dx

w is the deflection along the chain, theta the turn of the sections. The axial force N > 0 pulls; it
works on the whole slope w', as Engesser has it and as K_G of a solid does: a hinged beam buckles at
P_E / (1 + P_E / kappa G A), P_E = pi^2 E I / L^2. Haringx' theory, where N stands across the turned
section, differs by the square of P_E / kappa G A.
w is the mean deflection of a section. The chain touches the middle of its surface, which bulges
where the section bends: eps_x = -z w'' makes eps_z = nu z w'', and

    u_z = w + nu w'' / 2 (z^2 - y^2 - (h^2 - b^2) / 12)

(Timoshenko and Goodier, sec. 102, less its mean). The point touched, z = h / 2 and y = 0, therefore
moves by w + (a^2 / 2) w'' with a^2 = nu (2 h^2 + b^2) / 12, to second order the mean of w at the
two places a to either side of the strike. The contact reads the beam at these places and loads it
there, with half of the force at each.

Timoshenko, Phil. Mag. 41 (1921) 744; Engesser, Zentralbl. Bauverw. 11 (1891) 483; Bazant and
Cedolin, Stability of Structures (2010), sec. 1.7. Shear factors: Hutchinson, J. Appl. Mech. 68
(2001) 87, of a rectangle as wide as it is.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, csc_array, csr_matrix, diags_array
from skfem import MeshHex

from beadwave.fem.assembly.materials import Material
from beadwave.fem.bending.bending_model import (
    ACROSS,
    DOWN,
    Bending,
    Buckled,
    load_factor,
    vertex_by_vertex,
)
from beadwave.fem.bending.line_elements import divided, line, wave_length
from beadwave.fem.contact.contact_patch import ContactPatch
from beadwave.fem.contact.impact_point import SurfacePoint

# Division of a beam into elements
ORDER = 10  # of the elements
RESOLVED_HZ = 40e3  # a wave of this frequency is as long as an element, right to 1e-8
MIN_ELEMENTS = 2  # elements to either side of the strike
N_DRAWN_SLICES = 120  # of the beam as it is drawn


class BeamCorrection(NamedTuple):
    """Corrections of the beam theory towards a solid beam, fitted to solids of
    `examples/theory_errors.py` with width / thickness b / h from 0.5 to 3 and nu from 0.15 to 0.4.

    Under the sphere a solid, its half-space taken off, is stiffer than the theory. Its compliance
    is smaller, with x = ln(b / h), by

        (local_0 + local_1 x + local_2 x^2 + (of_poisson + of_both x) (nu - 0.3)) / E h,

    a fit that holds within 0.08 / E h. A clamped end also hinders the strain across the section,
    which acts as if the beam were clamp nu^2 sqrt(b h) shorter there, within a tenth of that.
    """

    local_0: float = 0.734
    local_1: float = -0.211
    local_2: float = -0.526
    of_poisson: float = -1.3
    of_both: float = 0.4
    clamp: float = 0.26

    def stiffer(self, section: "Section", material: Material) -> float:
        """Compliance [m/N] by which the theory exceeds the solid under the sphere."""
        x = np.log(np.clip(section.width / section.thickness, 0.5, 3.0))
        nu = material.poisson - 0.3
        local = self.local_0 + self.local_1 * x + self.local_2 * x**2
        local += (self.of_poisson + self.of_both * x) * nu
        return float(local / (material.young * section.thickness))

    def shorter(self, section: "Section", material: Material) -> float:
        """Length [m] by which a clamped end shortens the beam."""
        return self.clamp * material.poisson**2 * np.sqrt(section.width * section.thickness)


class Section(NamedTuple):
    """A beam's cross-section, and the box that it is drawn as."""

    area: float  # [m^2]
    second_moment: float  # [m^4] about the axis that it bends about
    shear_factor: float
    width: float  # [m] across
    thickness: float  # [m] along the chain
    bulge: float = 1.0  # share of the bulge that counts; 0 reads and loads w itself
    correction: BeamCorrection | None = None  # corrections of the theory towards solids


class BeamEnd(NamedTuple):
    """Springs at an end: inf is rigid, 0 is free."""

    shift: float  # [N/m]
    turn: float  # [N m/rad]


ENDS = {
    "hinged": BeamEnd(np.inf, 0.0),
    "clamped": BeamEnd(np.inf, np.inf),
    "free": BeamEnd(0.0, 0.0),
}


def rectangle(width: float, thickness: float, poisson: float) -> Section:
    """A rectangular section, width across and thickness along the chain [m].

    Hutchinson's factor of a rectangle of half the height a and half the width b,

        kappa = -2 (1 + nu) / (9 C / (4 a^5 b) + nu (1 - b^2 / a^2)),
        C = 4/45 a^3 b (-12 a^2 - 15 nu a^2 + 5 nu b^2)
            + sum_n 16 nu^2 b^5 (n pi a - b tanh(n pi a / b)) / ((n pi)^5 (1 + nu)):

    5 (1 + nu) / (6 + 5 nu) of a narrow one. It has the frequencies right to the second order in
    k h, and no more of a wide one, whose section bends across: that of WIDEST is taken there.
    """
    nu, a = poisson, thickness / 2
    # 2.5: width over thickness up to which a rectangle's own shear factor counts: at k h = 1 and nu
    # = 0.3 its frequencies are 0.1 % off those of elasticity where that is 2, the narrow one's -0.5
    # %; where it is 3, 0.9 and -1.1 %; where it is 4, 2.6 and -1.6 %
    b = min(width, 2.5 * thickness) / 2
    n_pi = np.pi * np.arange(1, 60)
    series = 16 * nu**2 * b**5 * (n_pi * a - b * np.tanh(n_pi * a / b)) / (n_pi**5 * (1 + nu))
    C = 4 / 45 * a**3 * b * (-12 * a**2 - 15 * nu * a**2 + 5 * nu * b**2) + series.sum()
    shear = float(-2 * (1 + nu) / (9 * C / (4 * a**5 * b) + nu * (1 - (b / a) ** 2)))
    return Section(width * thickness, width * thickness**3 / 12, shear, width, thickness)


def tube(diameter: float, bore: float, poisson: float) -> Section:
    """A circular section of outer and inner diameter [m]; a bore of 0 is a rod.

    Hutchinson's factor of a hollow circle of the radii a and b,

        kappa = 6 (a^2 + b^2)^2 (1 + nu)^2 / ((7 + 12 nu + 4 nu^2) (a^4 + b^4)
                + (34 + 48 nu + 16 nu^2) a^2 b^2):   6 (1 + nu)^2 / (7 + 12 nu + 4 nu^2) of a rod.
    """
    a, b, nu = diameter / 2, bore / 2, poisson
    squares, mixed, inner = a**2 + b**2, a**2 * b**2, a**4 + b**4
    poly = (7 + 12 * nu + 4 * nu**2) * inner + (34 + 48 * nu + 16 * nu**2) * mixed
    shear = 6 * squares**2 * (1 + nu) ** 2 / poly
    area = np.pi * (a**2 - b**2)
    return Section(area, area * squares / 4, shear, diameter, diameter)


def section(area: float, second_moment: float, shear_factor: float) -> Section:
    """A section of any shape, by its area [m^2], second moment [m^4] and shear factor; drawn as the
    rectangle of the same area and second moment."""
    thickness = np.sqrt(12 * second_moment / area)
    return Section(area, second_moment, shear_factor, area / thickness, thickness)


def beam(
    length: float,
    section: Section,
    material: Material,
    ends: tuple[BeamEnd, BeamEnd],
    position: float,
    *,
    axial_force: float = 0.0,
    coarser: float = 1.0,
) -> Bending:
    """A beam of a length [m] struck at a position [m] from its first end.

    axial_force [N] is positive where it pulls; elements are `coarser` times as long as usual.
    Raises Buckled where the force presses more than the beam can bear.
    """
    # a solid's clamped ends hinder the strain across the section: as if the beam were shorter
    clamped, correction = [end == ENDS["clamped"] for end in ends], section.correction
    if correction is not None:
        left, right = correction.shorter(section, material) * np.array(clamped)
        length, position = length - left - right, position - left
    rho, A, I = material.density, section.area, section.second_moment
    kGA = section.shear_factor * material.lame[1] * A
    EI = material.young * I

    # the strike is the mean of two places next to it; elements end there
    width, thickness = section.width, section.thickness
    squares = (2 * thickness**2 + width**2) / 12
    aside = np.sqrt(section.bulge * max(material.poisson, 0.0) * squares)
    aside = min(aside, position / 2, (length - position) / 2)
    struck = [position - aside, position + aside] if aside else [position]
    longest = coarser * wave_length(2 * np.pi * RESOLVED_HZ, kGA, EI, *(rho * np.array([A, I])))
    along = line(divided(sorted({0.0, *struck, length}), longest, MIN_ELEMENTS), ORDER)

    # all deflections w, then all turns theta: the module's energies V and T, row by row
    _, mass, slope, mixed = along
    K = block_array([[kGA * slope, -kGA * mixed.T], [-kGA * mixed, EI * slope + kGA * mass]])
    M = block_array([[A * mass, None], [None, I * mass]])
    K_G = block_array([[slope, None], [None, 0 * mass]])
    inertia = M @ np.append(along.one, 0 * along.one)

    # springs of both ends on the diagonal; what they hold rigidly is not free
    n = along.basis.N
    springs = np.zeros(2 * n)
    for x, end in zip((0.0, length), ends, strict=True):
        springs[[along.node(x), n + along.node(x)]] = end
    free = np.flatnonzero(np.isfinite(springs))
    K, M, K_G = (csc_array(form.tocsc()[free][:, free]) for form in (K, rho * M, K_G))
    K.setdiag(K.diagonal() + springs[free])

    # a pressing force is refused from the buckling load on: K + N K_G would be indefinite
    factor = None
    if axial_force < 0:
        factor = load_factor(K, axial_force * K_G)
        if factor >= 1:
            raise Buckled(
                f"a pressing force of {-axial_force:.6g} N is {factor:.4g} of the buckling load of "
                f"{-axial_force / factor:.6g} N; take less"
            )

    # a force on top, downwards
    dofs = [along.node(x) for x in struck]
    w = np.isin(free, dofs) / -len(dofs)
    spot = SurfacePoint(np.array([position, 0.0, section.thickness / 2]), DOWN, ACROSS)
    patch = ContactPatch(w, np.flatnonzero(w), w, spot, 0.0, "point")

    # drawn as a box whose vertices follow their section: u_x = -z theta, u_z = w
    x = np.linspace(0, length, N_DRAWN_SLICES + 1)
    sides = [np.array([-0.5, 0.5]) * side for side in (section.width, section.thickness)]
    box = MeshHex.init_tensor(x, *sides)
    section_of = np.abs(box.p[0][:, None] - x).argmin(axis=1)
    P = along.at(x)[section_of]
    turned, zero = diags_array(-box.p[2]) @ P, csr_matrix(P.shape)
    T = vertex_by_vertex([[zero, turned], [zero, zero], [P, zero]])
    return Bending(
        csc_array(K + axial_force * K_G) if axial_force else K,
        M,
        T[:, free],
        box,
        patch,
        rho * inertia[free],
        rho * A * length,
        half_space=0.0 if correction is None else correction.stiffer(section, material),
        load_factor=factor,
    )
