"""Solid bodies against the theory of beams, plates and tubes."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from skfem import MeshHex

from beadwave.fem import (
    Bushing,
    Connections,
    HeldFace,
    Joint,
    Material,
    Side,
    assemble,
    contact_patch,
    factorised,
    half_space_on_mesh,
    joined,
    modes,
)

ALUMINIUM = Material(70e9, 0.33, 2700.0)
ENDS = {"cantilever": ("clamped", "free"), "hinged": ("hinged", "hinged"), "free": ("free", "free")}
ZERO = {"clamped": (0, 1), "hinged": (0, 2), "free": (2, 3)}  # of deflection, turn, moment, shear


class Beam(NamedTuple):
    """Of one plane of bending."""

    length: float
    area: float
    inertia: float
    shear: float  # its coefficient
    material: Material = ALUMINIUM


def rectangle(length, width, height, material=ALUMINIUM):
    """Cowper, J. Appl. Mech. 33 (1966) 335."""
    nu = material.poisson
    shear = 10 * (1 + nu) / (12 + 11 * nu)
    return Beam(length, width * height, width * height**3 / 12, shear, material)


def timoshenko_hz(beam, ends, n):
    """The lowest frequencies, exactly: roots of the determinant of the transfer matrix."""
    E, G, rho = beam.material.young, beam.material.lame[1], beam.material.density

    def determinant(omega):
        A = np.zeros((4, 4))
        A[0, 1], A[0, 3] = -1.0, 1 / (beam.shear * G * beam.area)  # w' = -psi + V / kGA
        A[1, 2] = 1 / (E * beam.inertia)  # psi' = M / EI
        A[2, 1], A[2, 3] = -rho * beam.inertia * omega**2, 1.0  # M' = V - rho I omega^2 psi
        A[3, 0] = -rho * beam.area * omega**2  # V' = -rho A omega^2 w
        scale = np.array([beam.length, 1.0, E * beam.inertia / beam.length, 0.0])
        scale[3] = E * beam.inertia / beam.length**2
        B = beam.length * A * scale / scale[:, None]
        through = expm(B)
        start = np.setdiff1d(range(4), ZERO[ends[0]])
        return np.linalg.det(through[np.ix_(ZERO[ends[1]], start)])

    first = np.sqrt(E * beam.inertia / (rho * beam.area)) / beam.length**2  # rad/s
    trial = np.arange(1.0, 17.0 * (n + 1) ** 2, 0.5) * first
    values = [determinant(omega) for omega in trial]
    at = [i for i in range(len(trial) - 1) if values[i] * values[i + 1] < 0][:n]
    return np.array([brentq(determinant, *trial[i : i + 2]) for i in at]) / (2 * np.pi)


def boxed(*lines):
    """Hexahedra between lines along x, y and z, its faces named."""
    return MeshHex.init_tensor(*lines).with_boundaries(
        {
            f"{sign}{letter}": lambda x, i=i, end=line[k]: np.abs(x[i] - end) < 1e-9
            for i, (letter, line) in enumerate(zip("xyz", lines, strict=True))
            for sign, k in (("-", 0), ("+", -1))
        }
    )


LENGTH, WIDTH, HEIGHT = 0.8, 0.012, 0.008  # m
HELD = {"clamped": "xyz", "hinged": "yz", "free": ""}


@pytest.fixture(scope="module")
def beam():
    """Fine where it may be clamped."""
    along = np.append(np.linspace(0, 0.01, 5)[:-1], np.linspace(0.01, LENGTH, 61))
    mesh = boxed(along, np.linspace(0, WIDTH, 3), np.linspace(0, HEIGHT, 3))
    return assemble({"beam": mesh}, {"beam": ALUMINIUM})


def bending_hz(model, axis, n):
    """The lowest frequencies of modes that move along an axis."""
    computed = modes(model.K, model.M, n, shift_hz=50.0)
    u = model.T @ computed.phi
    along = np.sum(u[axis::3] * (model.structure.M @ u)[axis::3], axis=0)
    return computed.frequency_hz[(along > 0.8) & (computed.frequency_hz > 1.0)]


@pytest.mark.parametrize("kind", ENDS)
def test_beams_have_the_frequencies_of_timoshenko(beam, kind):
    """Five modes in either plane; a clamped end that cannot contract stiffens by 0.1 %."""
    ends = zip(("beam:-x", "beam:+x"), ENDS[kind], strict=True)
    held = [HeldFace(face, HELD[how]) for face, how in ends if HELD[how]]
    model = joined(beam, Connections(held=held))
    for axis, sides in ((1, (HEIGHT, WIDTH)), (2, (WIDTH, HEIGHT))):
        theory = timoshenko_hz(rectangle(LENGTH, *sides), ENDS[kind], 5)
        margin = 1.6e-3 if kind == "cantilever" else 1e-3
        np.testing.assert_allclose(bending_hz(model, axis, 24)[:5], theory, rtol=margin)


SIDE, THICKNESS = 0.3, 2e-3  # m
FREE = (13.468, 19.596, 24.270, 34.801, 34.801)  # nu = 0.3: Gorman, J. Sound Vib. 57 (1978) 437
HINGED = np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])  # Leissa, NASA SP-160, eq. 4.20
STEEL = Material(210e9, 0.3, 7850.0)


@pytest.mark.parametrize(("theory", "held"), [(FREE, False), (HINGED, True)])
def test_square_plates_have_the_frequencies_of_the_literature(theory, held):
    """Kirchhoff's plate; shear and rotary inertia of h/a = 1/150 take up to 0.1 %."""
    line = np.linspace(0, SIDE, 25)
    mesh = boxed(line, line, np.array([0, THICKNESS]))
    plate = assemble({"plate": mesh}, {"plate": STEEL})
    edges = {"-x": "yz", "+x": "yz", "-y": "xz", "+y": "xz"} if held else {}
    model = joined(plate, Connections(held=[HeldFace(f"plate:{f}", d) for f, d in edges.items()]))
    hz = modes(model.K, model.M, len(theory) + 6, shift_hz=20.0).frequency_hz
    D = STEEL.young * THICKNESS**3 / (12 * (1 - STEEL.poisson**2))
    unit = np.sqrt(D / (STEEL.density * THICKNESS)) / SIDE**2 / (2 * np.pi)
    np.testing.assert_allclose(hz[hz > 1.0][: len(theory)], unit * np.array(theory), rtol=3e-3)


@pytest.mark.slow
def test_a_small_free_block_has_six_rigid_motions_at_any_shift():
    """First elastic mode at 12 kHz, 2000 times the usual shift."""
    line = np.linspace(0, 0.05, 13)
    block = assemble({"block": boxed(line, line, np.linspace(0, 0.01, 4))}, {"block": STEEL})
    free = joined(block, Connections())
    usual, other = modes(free.K, free.M, 9), modes(free.K, free.M, 9, shift_hz=2e3)
    assert usual.frequency_hz[5] < 0.1 < 1e4 < usual.frequency_hz[6]
    np.testing.assert_allclose(usual.omega[6:] / other.omega[6:], 1.0, rtol=1e-8)
    np.testing.assert_allclose(modes(free.K, free.M, 4).frequency_hz, 0.0, atol=0.1)


OUTER, BORE, AROUND = 0.03, 0.02, 16


def tube(length, n):
    """A ring of quadrilaterals, extruded; the circles' areas are right, not their corners."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    swell = np.sqrt(2 * np.pi / AROUND / np.sin(2 * np.pi / AROUND))
    radii = swell * np.array([BORE, OUTER])
    ring = np.array([np.outer(radii, f(angle)).ravel() for f in (np.cos, np.sin)])
    i, j = np.meshgrid(range(1), range(AROUND), indexing="ij")
    corner = lambda a, b: (AROUND * a + b % AROUND).ravel()  # noqa: E731
    cells = np.array([corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)])
    z = np.linspace(0, length, n + 1)
    p = np.concatenate([np.tile(ring, n + 1), np.repeat(z, ring.shape[1])[None]])
    order = [0, 4, 3, 1, 7, 5, 2, 6]  # scikit-fem's corners, from a quadrilateral and its copy
    layers = [
        np.vstack([cells, cells + ring.shape[1]])[order] + k * ring.shape[1] for k in range(n)
    ]
    mesh = MeshHex(np.ascontiguousarray(p), np.ascontiguousarray(np.hstack(layers)))
    return assemble({"tube": mesh}, {"tube": STEEL})


def test_a_thick_walled_tube_twists_and_bends_as_theory_says():
    """Torsion of circular sections is exact, n / 2L sqrt(G / rho); bending by Timoshenko."""
    length = 0.6
    model = joined(tube(length, 40), Connections())
    computed = modes(model.K, model.M, 16, shift_hz=50.0)
    hz, u = computed.frequency_hz, model.T @ computed.phi
    twist = np.sqrt(STEEL.lame[1] / STEEL.density) / (2 * length)
    assert np.abs(hz / twist - 1).min() < 1e-3
    a, b, nu = OUTER**2, BORE**2, STEEL.poisson  # Hutchinson, J. Appl. Mech. 68 (2001) 87
    stiff = 7 * a**2 + 34 * a * b + 7 * b**2 + nu * (12 + 4 * nu) * (a**2 + 4 * a * b + b**2)
    shear = 6 * (a + b) ** 2 * (1 + nu) ** 2 / stiff
    area, inertia = np.pi * (OUTER**2 - BORE**2), np.pi * (OUTER**4 - BORE**4) / 4
    theory = timoshenko_hz(Beam(length, area, inertia, shear, STEEL), ENDS["free"], 3)
    across = np.sum(u[2::3] ** 2, axis=0) < 0.3 * np.sum(u**2, axis=0)
    bent = hz[across & (hz > 1.0) & (np.abs(hz / twist - 1) > 1e-2)]
    np.testing.assert_allclose(bent[:6], np.repeat(theory, 2), rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.0, 0.33])
def test_a_struck_beam_gives_way_like_a_beam_and_a_half_space(poisson):
    """Hinged at its ends, struck on its side. What the half-space leaves does not know the patch;
    it is L^3/48EI + L/4kGA, less 1/Eh as the beam is no half-space deep, and less the bulge of
    the bent section, nu M h^2/8EI, and what Cowper's k does not hold of Poisson's ratio."""
    solid = ALUMINIUM._replace(poisson=poisson)
    length, side = 0.3, 0.02
    fine = np.linspace(-0.005, 0.005, 7)
    far = np.linspace(0.005, length / 2, 15)[1:]
    along, across = np.concatenate([-far[::-1], fine, far]), np.linspace(-side / 2, side / 2, 9)
    depth = side - np.array([0.02, 0.012, 0.006, 0.0025, 0.0])
    bar = assemble({"bar": boxed(along, depth, across)}, {"bar": solid})
    start, open_but_x = np.array([-length / 2, 0, 0]), Bushing(np.inf, 0, 0, 0, 0, 0)
    axial = Joint("stop", Side("bar:-x", "mean"), None, start, open_but_x)
    ends = [HeldFace("bar:-x", "yz"), HeldFace("bar:+x", "yz")]
    model = joined(bar, Connections(joints=[axial], held=ends))
    factor, left = factorised(model.K), []
    for radius in (1e-3, 2.5e-3, 6e-3):
        patch = contact_patch(model, "bar:+y", (0.0, 0.0), radius)
        local = half_space_on_mesh(model, "bar:+y", patch, solid)
        left.append(patch.w @ factor.solve(patch.w) - local)
    assert np.ptp(left) < 1e-3 * left[0]
    theory = rectangle(length, side, side, solid)
    E, G = solid.young, solid.lame[1]
    bent = length**3 / (48 * E * theory.inertia) + length / (4 * theory.shear * G * theory.area)
    bulge = poisson * length * side**2 / (32 * E * theory.inertia)
    assert left[1] == pytest.approx(bent - bulge, rel=2e-3 if poisson == 0 else 5e-3)


def plate_without_half_space(side, h, radius, solid):
    """Compliance [m/N] of a hinged square plate under Hertz' pressure in its middle, less that of a
    half-space: exact in three dimensions.

    A free layer under sinusoidal pressure gives way by 2 (1 - nu^2) / (E k) L(k h), with
    L(x) = (sinh x cosh x + x) / (sinh^2 x - x^2), 1 for a half-space; the images of the half-space
    have the Madelung sum of a square of alternating charges, -1.61554.
    """
    E, nu = solid.young, solid.poisson
    m = np.arange(1, int(30 * side / h / np.pi), 2) * np.pi / side
    k = np.hypot(m[:, None], m)
    layer = (np.sinh(k * h) * np.cosh(k * h) + k * h) / (np.sinh(k * h) ** 2 - (k * h) ** 2)
    mean = 3 * (np.sin(k * radius) - k * radius * np.cos(k * radius)) / (k * radius) ** 3
    each = 4 / side**2 * mean**2 * 2 * (1 - nu**2) / (E * k) * (layer - 1)
    return each.sum() - 1.6155426 * (1 - nu**2) / (np.pi * E * side)


@pytest.mark.slow
def test_a_struck_plate_gives_way_like_a_plate_and_a_half_space():
    """Hinged, a quarter between mirrors. What the half-space leaves is that of Kirchhoff's plate,
    0.0116 a^2/D, within the 2 % that thickness adds, and does not know the patch."""
    side, h = 0.8, 0.02
    steps = [0, 2, 2, 2.5, 3.5, 6, 10, 16, 23, 30, 35, 40, 40, 45, 45, 50, 50]
    along = 1e-3 * np.cumsum(steps)
    assert along[-1] == pytest.approx(side / 2)
    quarter = boxed(along, along, np.array([0.0, 0.01, 0.015, 0.018, 0.02]))
    plate = assemble({"plate": quarter}, {"plate": STEEL})
    edges = {"-x": "x", "-y": "y", "+x": "yz", "+y": "xz"}
    held = [HeldFace(f"plate:{face}", axes) for face, axes in edges.items()]
    model = joined(plate._replace(K=4 * plate.K), Connections(held=held))
    factor, left, radii = factorised(model.K), [], (1e-3, 2.5e-3, 6e-3)
    for radius in radii:
        patch = contact_patch(model, "plate:+z", (-side / 4, -side / 4), radius, mirrors="xy")
        local = half_space_on_mesh(
            model, "plate:+z", patch, STEEL, mirrors=("plate:-x", "plate:-y")
        )
        left.append(patch.w @ factor.solve(patch.w) - local)
    assert np.ptp(left) < 1e-3 * left[0]
    exact = [plate_without_half_space(side, h, radius, STEEL) for radius in radii]
    np.testing.assert_allclose(np.array(left) / exact, 1.0, rtol=1e-3)
    D = STEEL.young * h**3 / (12 * (1 - STEEL.poisson**2))
    assert left[0] / (0.0116 * side**2 / D) == pytest.approx(1.0, abs=0.02)
