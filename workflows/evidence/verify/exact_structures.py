"""Structures beside closed solutions and finer meshes."""

from collections.abc import Iterator

import numpy as np
from scipy.linalg import eigh

from beadwave import fem
from beadwave.coupling import RayleighDamping, damping_ratios
from beadwave.fem.beam import Section
from beadwave.fem.factorisation import factorised
from beadwave.fem.hinged import euler_bernoulli, lamb_hz
from beadwave.geometry.grid_lines import graded
from beadwave.workflows.evidence.harness import Comparison, compared
from beadwave.workflows.evidence.verify.blocks import block, held_block
from beadwave.workflows.evidence.verify.exact_reductions import JOHNSON, sphere_on_modes

STEEL = fem.Material(210e9, 0.3, 7850.0)
ROD = "the rod, f_j = (2 j - 1) c / 4 L"
LAMB = "H. Lamb, Proc. R. Soc. A 93 (1917) 114, antisymmetric waves"
SIDES = 0.131, 0.099, 0.041  # m, of the struck block
BLOCK = "three independent meshes, quarter model of quadratic hexahedra"
POINT = "a point force on a half-space, u ~ 1/h"
NODE = "a mesh of other elements, whose nodes take more or less"


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

    length, side = 0.1535, 0.01
    section = Section(side**2, side**4 / 12, 5 / 6, side, side)
    omega, phi, _ = euler_bernoulli(length, section, STEEL, length / 2, 39)
    yield sphere_on_modes("sphere on a hinged beam [V]", omega, phi)

    # a block: compliance under the patch, its half-space on the same mesh, and their difference
    seed = 4e-3
    across = [graded(-side / 2, side / 2, 0.0, seed, 12e-3) for side in SIDES[1:]]
    model = held_block(graded(0.0, SIDES[0], SIDES[0], seed, 12e-3), *across, material=STEEL)
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


def _natural_hz(lines, material: fem.Material, rollers: dict[str, str]) -> np.ndarray:
    """All natural frequencies [Hz] of a bar of hexahedra on these grid lines, whose faces are held
    in the directions of `rollers`."""
    supports = [fem.HeldFace(f"block:{side}", directions) for side, directions in rollers.items()]
    model = fem.joined(block(*lines, material=material), fem.Connections(held=supports))
    squared = eigh(model.K.toarray(), model.M.toarray(), eigvals_only=True)
    return np.sqrt(np.abs(squared)) / (2 * np.pi)


def contact_node() -> Iterator[Comparison]:
    """A force at a node of the block deflects it like 1/h, by a factor of the element's own."""
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
