"""Structures beside closed solutions and finer meshes."""

from collections.abc import Iterator

import numpy as np
from scipy.linalg import eigh
from skfem import MeshHex

import fem
from coupling import RayleighDamping, damping_ratios
from coupling.verification.comparisons import Comparison, compared
from coupling.verification.exact import sphere_on_modes
from fem.beam import Section
from fem.factorisation import factorised
from fem.hinged import euler_bernoulli, lamb_hz
from geometry.hex_mesh import graded

STEEL = fem.Material(210e9, 0.3, 7850.0)
ROD = "the rod, f_j = (2 j - 1) c / 4 L"
LAMB = "H. Lamb, Proc. R. Soc. A 93 (1917) 114, antisymmetric waves"
BLOCK = "three independent meshes, quarter model of quadratic hexahedra"


def structures() -> Iterator[Comparison]:
    """Rod, strip and block beside theory, a sphere on a beam, damping ratios."""
    yield from _rod()
    yield from _strip()
    yield _sphere_on_a_beam()
    yield from _block()
    yield _rayleigh()


def _rod() -> Iterator[Comparison]:
    """Quadratic elements: the frequency's error falls with the fourth power of their length."""
    length, j = 0.5, np.arange(1, 4)
    exact = (2 * j - 1) / (4 * length) * np.sqrt(STEEL.young / STEEL.density)
    found = np.array([_axial_hz(length, n)[:3] for n in (8, 16)])
    yield compared("rod of 16 elements, three frequencies [Hz]", found[1], exact,
                   allowed=1e-4, source=ROD)  # fmt: skip
    errors = found[:, 2] / exact[2] - 1
    yield compared("rod, order of its third frequency", np.log2(errors[0] / errors[1]), 4.0,
                   allowed=0.1, of=1.0, source=ROD)  # fmt: skip


def _axial_hz(length: float, n: int) -> np.ndarray:
    """Of a bar without lateral contraction on rollers, held at one end."""
    lines = (np.linspace(0, length, n + 1), *[(0.0, 5e-3)] * 2)
    sides = {"-x": (0, 0.0), "-y": (1, 0.0), "+y": (1, 5e-3), "-z": (2, 0.0), "+z": (2, 5e-3)}
    held = [fem.Held(f"rod:{face}", face[1]) for face in sides]
    return _natural_hz("rod", lines, sides, STEEL._replace(poisson=0.0), held)


def _strip() -> Iterator[Comparison]:
    """Bending in plane strain between ends that only move along: standing waves of Lamb's."""
    length, height, n = 0.2, 0.02, np.arange(1, 4)
    exact = np.array([lamb_hz(k, height / 2, STEEL) for k in n * np.pi / length])
    found = np.array([_bending_hz(length, height, cells)[1:4] for cells in (8, 16)])
    yield compared("strip of 16 x 2 elements, three frequencies [Hz]", found[1], exact,
                   allowed=2e-3, source=LAMB)  # fmt: skip
    errors = found[:, 2] / exact[2] - 1
    yield compared("strip, order of its third frequency", np.log2(errors[0] / errors[1]), 4.0,
                   allowed=0.3, of=1.0, source=LAMB)  # fmt: skip


def _bending_hz(length: float, height: float, n: int) -> np.ndarray:
    lines = (np.linspace(0, length, n + 1), [0, 0.01], np.linspace(0, height, n // 8 + 1))
    sides = {"-x": (0, 0.0), "+x": (0, length), "-y": (1, 0.0), "+y": (1, 0.01)}
    held = [fem.Held(f"strip:{face}", "z" if face[1] == "x" else "y") for face in sides]
    return _natural_hz("strip", lines, sides, STEEL, held)


def _natural_hz(name: str, lines, sides, material: fem.Material, held) -> np.ndarray:
    """All natural frequencies of a bar of hexahedra whose `sides` (axis, place) have names."""
    mesh = MeshHex.init_tensor(*(np.asarray(line, float) for line in lines)).with_boundaries({
        side: lambda x, axis=axis, at=at: np.abs(x[axis] - at) < 1e-9
        for side, (axis, at) in sides.items()
    })  # fmt: skip
    bar = fem.assemble({name: mesh}, {name: material})
    model = fem.joined(bar, fem.Connections(held=held))
    squared = eigh(model.K.toarray(), model.M.toarray(), eigvals_only=True)
    return np.sqrt(np.abs(squared)) / (2 * np.pi)


def _sphere_on_a_beam() -> Comparison:
    length, side = 0.1535, 0.01
    section = Section(side**2, side**4 / 12, 5 / 6, side, side)
    omega, phi, _ = euler_bernoulli(length, section, STEEL, length / 2, 39)
    return sphere_on_modes("sphere on a hinged beam [V]", omega, phi)


def _block() -> Iterator[Comparison]:
    """Compliance under the patch less that of the half-space on the same mesh."""
    a, b, h, seed = 0.131, 0.099, 0.041, 4e-3  # m
    across = [graded(-side / 2, side / 2, 0.0, seed, 12e-3) for side in (b, h)]
    mesh = MeshHex.init_tensor(graded(0.0, a, a, seed, 12e-3), *across).with_boundaries({
        "+x": lambda x: np.abs(x[0] - a) < 1e-9, "-x": lambda x: np.abs(x[0]) < 1e-9,
    })  # fmt: skip
    block = fem.assemble({"block": mesh}, {"block": STEEL})
    model = fem.joined(block, fem.Connections(held=[fem.Held("block:-x")]))
    solver = factorised(model.K)
    for weights, pressure in (("hertz", "Hertz'"), ("area", "even")):
        patch = fem.contact_patch(model, "block:+x", (0.0, 0.0), 6.4e-3, weights=weights)
        local = fem.half_space_on_mesh(model, "block:+x", patch, STEEL)
        name = f"struck block, {pressure} pressure, compliance less the half-space [m/N]"
        left = patch.w @ solver.solve(patch.w) - local
        yield compared(name, left, 9.13e-11, allowed=0.02, source=BLOCK)


def _rayleigh() -> Comparison:
    omega = 2 * np.pi * np.array([51.0, 269.0, 907.0, 8425.0])
    found = damping_ratios(RayleighDamping(514.53, 1.72e-8), omega)
    implied = [0.80, 0.15, 0.045, 0.0053]
    return compared("Rayleigh damping of the thesis, four ratios", found, implied,
                    allowed=5e-3, of=1.0, source="the thesis, (6.1)")  # fmt: skip
