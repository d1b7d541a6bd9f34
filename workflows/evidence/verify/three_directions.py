"""A structure along the normal and across: closed solutions, turned and mirrored structures."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beadwave import fem, rom
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.fem.factorisation import Factor, factorised
from beadwave.geometry.grid_lines import graded
from beadwave.workflows.evidence.harness import Comparison, compared
from beadwave.workflows.evidence.verify.blocks import held_block

STEEL = fem.Material(210e9, 0.3, 7850.0)
G = STEEL.young / (2 * (1 + STEEL.poisson))
SIDES = {"x": 0.131, "y": 0.099, "z": 0.041}  # m
TO_HZ = 12e3
JOHNSON = "K. L. Johnson, Contact Mechanics (1985), 3.91, 0.15 (2 - nu) / (G b)"
TIMOSHENKO = "Timoshenko's cantilever, L^3 / 3 E I + L / kappa G A"
TURNED = "the same structure turned by 90 degrees about n"
RECIPROCAL = "the load at the shaker, read at the contact"
PATCH = "another radius of the patch"
FULL = "the full model, K^-1"
RADII = (1e-3, 2e-3, 4e-3, 6e-3)  # m


class HeldBar(NamedTuple):
    """A bar held at -x, with the factor of its stiffness."""

    model: fem.Model
    factor: Factor
    material: fem.Material


def three_directions() -> Iterator[Comparison]:
    """Compliances across, patches, a structure turned, reciprocity of contact and shaker."""
    # a slender cantilever pushed across at its end: bending and shear, the half-space taken out;
    # without lateral contraction, which its clamped end would hinder
    length, side = 0.4, 0.02
    x = graded(0.0, length, length, 2.5e-3, 20e-3)
    across = graded(-side / 2, side / 2, 0.0, 2.5e-3, 5e-3)
    material = STEEL._replace(poisson=0.0)
    left, _ = _across(_held(x, across, across, material=material), (0.0, 0.0), 4e-3)
    kappa_G = 5 / 6 * material.young / 2
    exact = length**3 / (material.young * side**4 / 4) + length / (kappa_G * side**2)
    yield compared("cantilever pushed across at its end, less the half-space [m/N]",
                   left, exact, allowed=1e-3, source=TIMOSHENKO)  # fmt: skip

    # a block beside the middle of its face: its half-space, and what patches leave of it
    seed = 4e-3
    x = graded(0.0, SIDES["x"], SIDES["x"], seed, 12e-3)
    lines = [graded(-SIDES[a] / 2, SIDES[a] / 2, 0.0, seed, 12e-3) for a in "yz"]
    block = _held(x, *lines)
    left, local = np.array([_across(block, (0.01, 0.0), radius) for radius in RADII]).swapaxes(0, 1)
    yield compared("half-space across under a patch of 6 mm, on a block's mesh [m/N]",
                   local[-1], 0.15 * (2 - STEEL.poisson) / (G * RADII[-1]),
                   allowed=0.05, source=JOHNSON)  # fmt: skip
    for axis, compliance in zip(("t1", "t2"), left.T, strict=True):
        yield compared(f"block along {axis}, patches of 1, 2 and 4 mm beside 6 mm [m/N]",
                       compliance[:-1], compliance[-1], allowed=1e-3, source=PATCH)  # fmt: skip

    # walls of reduced models: a coarse block, and the same with y and z changed. Turned about x, y
    # becomes z and z becomes -y; n is -x, t1 = y and t2 = -z, so that t1 is -t2 and t2 is t1
    wall, static = _wall("xyz", (0.012, 0.003), "+y", (0.01, 0.004))
    turned, _ = _wall("xzy", (-0.003, 0.012), "+z", (0.01, -0.004))
    Q = np.eye(4)
    Q[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]
    for hz in (900.0, 9e3):
        ours, theirs = _receptance(wall, hz), Q @ _receptance(turned, hz) @ Q.T
        yield compared(f"receptances of n, t1, t2 and a shaker at {hz:g} Hz [m/N]",
                       np.abs(ours), np.abs(theirs), allowed=1e-9, source=TURNED)  # fmt: skip
        yield compared(f"the contact at {hz:g} Hz under the shaker's force [m/N]",
                       np.abs(ours[:3, 3]), np.abs(ours[3, :3]),
                       allowed=1e-10, source=RECIPROCAL)  # fmt: skip
    yield compared("static compliance of n, t1, t2 and a shaker [m/N]",
                   _receptance(wall, 0.0).real * (1 + rom.LOSS**2), static,
                   allowed=1e-9, source=FULL)  # fmt: skip


def _held(*lines: np.ndarray, material: fem.Material = STEEL) -> HeldBar:
    """A bar of hexahedra between these grid lines along x, y and z [m], held at its lower end."""
    model = held_block(*lines, material=material)
    return HeldBar(model, factorised(model.K), material)


def _across(held: HeldBar, at: tuple[float, float], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Compliances (2,) [m/N] along t1 and t2 less the half-space's on the mesh, and these."""
    patch = fem.contact_patch(held.model, "block:+x", at, radius)
    local = np.diag(fem.half_space_matrix(held.model, "block:+x", patch, held.material))[1:]
    whole = [direction.w @ held.factor.solve(direction.w) for direction in patch.across(held.model)]
    return np.array(whole) - local, local


def _wall(
    order: str, at: tuple[float, float], shaken: str, shaken_at: tuple[float, float]
) -> tuple[SpatialWall, np.ndarray]:
    """The wall of a block whose sides `order` names, struck on +x and shaken normal to another
    face; and its static compliance (4, 4) [m/N] by all unknowns."""
    counts = {"x": 6, "y": 7, "z": 4}
    lines = [np.linspace(-SIDES[a] / 2, SIDES[a] / 2, counts[a] + 1) for a in order]
    model, factor, _ = _held(*lines)
    patch = fem.contact_patch(model, "block:+x", at, 3e-3)
    shaker = fem.contact_patch(model, f"block:{shaken}", shaken_at, 4e-3, weights="area").w
    W = np.column_stack([patch.w, *(direction.w for direction in patch.across(model)), shaker])
    selection = rom.Selection(25, to_hz=TO_HZ, choice="contact")
    solver = {"factor": factor, "factorise": factorised}
    reduced = rom.free_modes(model.K, model.M, patch.w, selection, **solver)
    reduced, columns = rom.with_columns(
        reduced, model.K, model.M, W[:, 1:], options=rom.ColumnOptions(TO_HZ), **solver
    )
    local = fem.half_space_matrix(model, "block:+x", patch, STEEL)
    columns = rom.Columns(columns[:, :2], local, patch.axes, load=columns[:, 2:])
    static = W.T @ factor.solve(np.asfortranarray(W))
    return spatial_wall_of(reduced._replace(columns=columns)), static


def _receptance(wall: SpatialWall, hz: float) -> np.ndarray:
    """(4, 4) [m/N] between n, t1, t2 and the shaker, the half-space left in."""
    P = np.column_stack([wall.phi, wall.load])
    return (P.T / (wall.omega**2 * (1 + 1j * rom.LOSS) - (2 * np.pi * hz) ** 2)) @ P
