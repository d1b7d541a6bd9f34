"""Structures beside closed solutions and finer meshes."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq
from skfem import MeshHex

from beadwave import fem
from beadwave.coupling import RayleighDamping, damping_ratios
from beadwave.fem.modes.solver.factorisation import Factor, factorised
from beadwave.geometry.meshing.grid_lines import graded
from beadwave.workflows.evidence.harness import Comparison, compared
from beadwave.workflows.evidence.verify.exact_reductions import JOHNSON, sphere_on_modes

STEEL = fem.Material(210e9, 0.3, 7850.0)
ROD = "the rod, f_j = (2 j - 1) c / 4 L"
LAMB = "H. Lamb, Proc. R. Soc. A 93 (1917) 114, antisymmetric waves"
SIDES = 0.131, 0.099, 0.041  # m, of the struck block
BLOCK = "three independent meshes, quarter model of quadratic hexahedra"
POINT = "a point force on a half-space, u ~ 1/h"
NODE = "a mesh of other elements, whose nodes take more or less"
CANTILEVER = "Timoshenko's cantilever, L^3 / 3 E I + L / kappa G A"
ACROSS = "K. L. Johnson, Contact Mechanics (1985), 3.91, 0.15 (2 - nu) / (G b)"


def structures() -> Iterator[Comparison]:
    """Rod, strip and block beside theory, a sphere on a beam, damping ratios."""
    # a rod without lateral contraction on rollers, held at one end: the frequency's error of
    # quadratic elements falls with the fourth power of their length
    length, j = 0.5, np.arange(1, 4)
    exact = (2 * j - 1) / (4 * length) * np.sqrt(STEEL.young / STEEL.density)
    rollers = {side: side[1] for side in ("-x", "-y", "+y", "-z", "+z")}
    hz = []
    for n in (8, 16):
        lines = (np.linspace(0, length, n + 1), *[(0.0, 5e-3)] * 2)
        hz.append(_natural_hz(lines, STEEL._replace(poisson=0.0), rollers)[:3])
    yield compared("rod of 16 elements, three frequencies [Hz]", hz[1], exact,
                   allowed=1e-4, source=ROD)  # fmt: skip
    coarse, fine = (f[2] / exact[2] - 1 for f in hz)
    yield compared("rod, order of its third frequency", np.log2(coarse / fine), 4.0,
                   allowed=0.1, of=1.0, source=ROD)  # fmt: skip

    # bending in plane strain between ends that only move along: standing waves of Lamb's
    length, height = 0.2, 0.02
    exact = np.array([lamb_hz(k, height / 2, STEEL) for k in np.arange(1, 4) * np.pi / length])
    rollers = {"-x": "z", "+x": "z", "-y": "y", "+y": "y"}
    hz = []
    for n in (8, 16):
        lines = (np.linspace(0, length, n + 1), [0, 0.01], np.linspace(0, height, n // 8 + 1))
        hz.append(_natural_hz(lines, STEEL, rollers)[1:4])
    yield compared("strip of 16 x 2 elements, three frequencies [Hz]", hz[1], exact,
                   allowed=2e-3, source=LAMB)  # fmt: skip
    coarse, fine = (f[2] / exact[2] - 1 for f in hz)
    yield compared("strip, order of its third frequency", np.log2(coarse / fine), 4.0,
                   allowed=0.3, of=1.0, source=LAMB)  # fmt: skip

    # modes of a hinged beam of Euler and Bernoulli, w = sin(k x), struck in the middle
    length, side = 0.1535, 0.01
    k, rho_A = np.arange(1, 40) * np.pi / length, STEEL.density * side**2
    omega = k**2 * np.sqrt(STEEL.young * side**4 / 12 / rho_A)
    phi = np.sqrt(2 / (rho_A * length)) * np.sin(k * length / 2)
    yield sphere_on_modes("sphere on a hinged beam [V]", omega, phi)

    # a block: compliance under the patch, its half-space on the same mesh, and their difference
    model = struck_block()
    solver = factorised(model.K)
    for weights, pressure in (("hertz", "Hertz'"), ("area", "even")):
        patch = fem.contact_patch(model, "block:+x", (0.0, 0.0), 6.4e-3, weights=weights)
        local = fem.half_space_on_mesh(model, "block:+x", patch, STEEL)
        compliance = patch.w @ solver.solve(patch.w)
        yield compared(
            f"struck block, {pressure} pressure, compliance less the half-space [m/N]",
            compliance - local, 9.13e-11, allowed=0.02, source=BLOCK,
        )  # fmt: skip
        if weights == "hertz":
            yield compared("struck block, Hertz' pressure, whole compliance [m/N]",
                           compliance, 4.9756e-10, allowed=0.03, source=BLOCK)  # fmt: skip
            yield compared("half-space under Hertz' pressure, on the block's mesh [m/N]",
                           local, 4.0625e-10, allowed=0.03, source=JOHNSON)  # fmt: skip

    omega = 2 * np.pi * np.array([51.0, 269.0, 907.0, 8425.0])
    ratios = damping_ratios(RayleighDamping(514.53, 1.72e-8), omega)
    yield compared("Rayleigh damping of the thesis, four ratios", ratios,
                   [0.80, 0.15, 0.045, 0.0053],
                   allowed=5e-3, of=1.0, source="the thesis, (6.1)")  # fmt: skip


def lamb_hz(k: float, h: float, material: fem.Material) -> float:
    """Frequency [Hz] of the lowest antisymmetric wave of the wave number k [1/m] in a strip of half
    the height h [m]; raises ValueError for a k h at which it lies outside of the range below:

    4 k^2 a b tanh(b h) = (k^2 + b^2)^2 tanh(a h), a^2 = k^2 - (omega / c_l)^2, b^2 = k^2 -
    (omega / c_t)^2: between a half and all of the thin strip's."""
    E, nu, rho = material
    c_l = np.sqrt(E * (1 - nu) / (rho * (1 + nu) * (1 - 2 * nu)))
    c_t = np.sqrt(E / (2 * rho * (1 + nu)))

    def dispersion(omega: float) -> float:
        """Difference of both sides, without their poles: both sides are multiplied out."""
        a, b = np.sqrt(k**2 - omega**2 / np.array([c_l, c_t]) ** 2)
        return 4 * k**2 * a * b * np.tanh(b * h) - (k**2 + b**2) ** 2 * np.tanh(a * h)

    thin = k**2 * h * np.sqrt(E / (3 * rho * (1 - nu**2)))
    return brentq(dispersion, 0.5 * thin, thin, xtol=1e-9 * thin) / (2 * np.pi)


def contact_node() -> Iterator[Comparison]:
    """A force at a node of the block deflects it like 1/h, by a factor of its elements."""
    compliances = []  # [m/N] of the node at the contact
    for h in (1.6e-3, 0.8e-3, 0.4e-3):
        # grid lines from the contact outwards: two cubes of side h on each side, then larger ones
        outward = [
            np.append([0.0, h], graded(2 * h, end, 2 * h, 1.5 * h, 25e-3))
            for end in (SIDES[0], SIDES[1] / 2, SIDES[2] / 2)
        ]
        across = [np.append(-line[:0:-1], line) for line in outward[1:]]
        model = held_block(SIDES[0] - outward[0][::-1], *across, material=STEEL)
        w = fem.node_patch(model, "block:+x", [(0.0, 0.0)]).w
        compliances.append(w @ factorised(model.K).solve(w))
    compliances = np.array(compliances)
    yield compared("struck block, a node's compliance at 1.6, 0.8, 0.4 mm [m/N]", compliances,
                   [7.5e-9, 1.39e-8, 2.89e-8], allowed=0.15, source=NODE)  # fmt: skip
    yield compared("struck block, growth of it at half the element",
                   compliances[1:] / compliances[:-1], 2.0,
                   allowed=0.03, of=1.0, source=POINT)  # fmt: skip


def three_directions() -> Iterator[Comparison]:
    """Compliances across the normal: a slender cantilever, and the half-space of a patch."""
    # a slender cantilever pushed across at its end: bending and shear, the half-space taken out;
    # without lateral contraction, which its clamped end would hinder
    length, side = 0.4, 0.02
    x = graded(0.0, length, length, 2.5e-3, 20e-3)
    y_z = graded(-side / 2, side / 2, 0.0, 2.5e-3, 5e-3)
    material = STEEL._replace(poisson=0.0)
    cantilever = held_block(x, y_z, y_z, material=material)
    rest, _ = compliances_across(
        cantilever, factorised(cantilever.K), material, (0.0, 0.0), 4e-3
    )  # fmt: skip
    kappa_G = 5 / 6 * material.young / 2
    exact = length**3 / (material.young * side**4 / 4) + length / (kappa_G * side**2)
    yield compared("cantilever pushed across at its end, less the half-space [m/N]",
                   rest, exact, allowed=1e-3, source=CANTILEVER)  # fmt: skip

    block, radius = struck_block(), 6e-3
    _, local = compliances_across(block, factorised(block.K), STEEL, (0.01, 0.0), radius)
    G = STEEL.young / (2 * (1 + STEEL.poisson))
    yield compared("half-space across under a patch of 6 mm, on a block's mesh [m/N]",
                   local, 0.15 * (2 - STEEL.poisson) / (G * radius),
                   allowed=0.05, source=ACROSS)  # fmt: skip


def struck_block() -> fem.Model:
    """The block of steel with a fine mesh at the middle of its face +x, clamped at -x."""
    x = graded(0.0, SIDES[0], SIDES[0], 4e-3, 12e-3)
    y_z = [graded(-side / 2, side / 2, 0.0, 4e-3, 12e-3) for side in SIDES[1:]]
    return held_block(x, *y_z, material=STEEL)


def compliances_across(
    model: fem.Model, factor: Factor, material: fem.Material, at: tuple[float, float], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compliances (2,) [m/N] along t1 and t2 of a patch on +x less the half-space's on the mesh,
    and these."""
    patch = fem.contact_patch(model, "block:+x", at, radius)
    local = np.diag(fem.half_space_matrix(model, "block:+x", patch, material))[1:]
    whole = [direction.w @ factor.solve(direction.w) for direction in patch.across(model)]
    return np.array(whole) - local, local


def block(*lines: np.ndarray, material: fem.Material) -> fem.Structure:
    """The body "block" between grid lines along x, y and z, (n,) [m] each and ascending, its faces
    named -x to +z."""
    x_y_z = [np.asarray(line, float) for line in lines]
    faces = {
        f"{sign}{axis}": lambda x, i=i, at=x_y_z[i][end]: np.abs(x[i] - at) < 1e-9
        for i, axis in enumerate("xyz")
        for sign, end in (("-", 0), ("+", -1))
    }
    mesh = MeshHex.init_tensor(*x_y_z).with_boundaries(faces)
    return fem.assemble({"block": mesh}, {"block": material})


def held_block(*lines: np.ndarray, material: fem.Material) -> fem.Model:
    """The block between grid lines as of `block`, clamped at -x."""
    held = [fem.HeldFace("block:-x")]
    return fem.joined(block(*lines, material=material), fem.Connections(held=held))


def _natural_hz(lines, material: fem.Material, rollers: dict[str, str]) -> np.ndarray:
    """All natural frequencies [Hz] of a bar of hexahedra on these grid lines, whose faces are held
    in the directions of `rollers`."""
    supports = [fem.HeldFace(f"block:{side}", directions) for side, directions in rollers.items()]
    model = fem.joined(block(*lines, material=material), fem.Connections(held=supports))
    squared = eigh(model.K.toarray(), model.M.toarray(), eigvals_only=True)
    return np.sqrt(np.abs(squared)) / (2 * np.pi)
