"""A structure along the normal and across: patches of any radius, the structure turned by 90
degrees, reciprocity, the full model."""

import numpy as np
import pytest

from beadwave import fem, rom
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.fem.modes.solver.factorisation import factorised
from beadwave.workflows.evidence.verify.exact_structures import (
    SIDES,
    STEEL,
    compliances_across,
    held_block,
    struck_block,
)

TO_HZ = 12e3
RADII = (1e-3, 2e-3, 4e-3, 6e-3)  # m
TURNED = "the same structure turned by 90 degrees about n"
RECIPROCAL = "the load at the shaker, read at the contact"
PATCH = "another radius of the patch"
FULL = "the full model, K^-1"


@pytest.mark.slow
def test_compliances_across_do_not_depend_on_the_patch(compare):
    """Less the half-space's, beside the middle of a face."""
    block = struck_block()
    factor = factorised(block.K)
    rest = np.array(
        [compliances_across(block, factor, STEEL, (0.01, 0.0), radius)[0] for radius in RADII]
    )
    for axis, compliance in zip(("t1", "t2"), rest.T, strict=True):
        compare(f"block along {axis}, patches of 1, 2 and 4 mm beside 6 mm [m/N]",
                compliance[:-1], compliance[-1], allowed=1e-3, source=PATCH)  # fmt: skip


@pytest.mark.slow
def test_a_reduced_wall_turned_with_its_structure_answers_the_same(compare):
    """A coarse block, and the same with y and z changed. Turned about x, y becomes z and z becomes
    -y; n is -x, t1 = y and t2 = -z, so that t1 is -t2 and t2 is t1."""
    wall, static = wall_of_block("xyz", (0.012, 0.003), "+y", (0.01, 0.004))
    turned, _ = wall_of_block("xzy", (-0.003, 0.012), "+z", (0.01, -0.004))
    Q = np.eye(4)
    Q[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]
    for hz in (900.0, 9e3):
        ours, theirs = receptance(wall, hz), Q @ receptance(turned, hz) @ Q.T
        compare(f"receptances of n, t1, t2 and a shaker at {hz:g} Hz [m/N]",
                np.abs(ours), np.abs(theirs), allowed=1e-9, source=TURNED)  # fmt: skip
        compare(f"the contact at {hz:g} Hz under the shaker's force [m/N]",
                np.abs(ours[:3, 3]), np.abs(ours[3, :3]),
                allowed=1e-10, source=RECIPROCAL)  # fmt: skip
    compare("static compliance of n, t1, t2 and a shaker [m/N]",
            receptance(wall, 0.0).real * (1 + rom.LOSS**2), static,
            allowed=1e-9, source=FULL)  # fmt: skip


def wall_of_block(
    order: str, at: tuple[float, float], shaken: str, shaken_at: tuple[float, float]
) -> tuple[SpatialWall, np.ndarray]:
    """The wall of a block whose sides `order` names, struck on +x and shaken normal to another
    face; and its static compliance (4, 4) [m/N] by all unknowns."""
    counts = {"x": 6, "y": 7, "z": 4}
    sides = dict(zip("xyz", SIDES, strict=True))
    lines = [np.linspace(-sides[a] / 2, sides[a] / 2, counts[a] + 1) for a in order]
    model = held_block(*lines, material=STEEL)
    factor = factorised(model.K)
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


def receptance(wall: SpatialWall, hz: float) -> np.ndarray:
    """(4, 4) [m/N] between n, t1, t2 and the shaker, the half-space left in."""
    P = np.column_stack([wall.phi, wall.load])
    return (P.T / (wall.omega**2 * (1 + 1j * rom.LOSS) - (2 * np.pi * hz) ** 2)) @ P
