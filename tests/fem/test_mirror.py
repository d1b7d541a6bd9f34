"""A quarter and a half of a plate with mirror planes stand for the whole plate."""

from functools import cache

import numpy as np
import pytest

from beadwave.fem import (
    Material,
    assemble,
    contact_patch,
    factorised,
    half_space_on_mesh,
    mirrored,
    modes,
)
from beadwave.geometry import Extent, by_body, plate_mesh

STEEL = Material(210e9, 0.3, 7850.0)
SIDE, THICKNESS, RADIUS = 0.06, 0.01, 2e-3  # m
LOWER = {"": (-SIDE, -SIDE), "y": (0.0, -SIDE), "yz": (0.0, 0.0)}
SIZES = {"seed": 20e-3, "contact_seed": 5e-3}


@cache
def plate(mirrors):
    """Model, patch and compliance of the half-space of a plate with some mirror planes."""
    y, z = LOWER[mirrors]
    mesh = plate_mesh(THICKNESS, Extent((y, SIDE), (z, SIDE)), **SIZES)
    faces = [f"plate:-{axis}" for axis in mirrors]
    held = [f"plate:{s}{a}" for a in "yz" for s in "+-" if f"plate:{s}{a}" not in faces]
    model = mirrored(assemble(by_body(mesh), {"plate": STEEL}), held, faces)
    middle = (-(y + SIDE) / 2, -(z + SIDE) / 2)
    patch = contact_patch(model, "plate:+x", middle, RADIUS, mirrors=mirrors)
    local = half_space_on_mesh(model, "plate:+x", patch, STEEL, mirrors=faces)
    return model, patch, local


def compliance(mirrors):
    model, patch, _ = plate(mirrors)
    return patch.w @ factorised(model.K).solve(patch.w)


@pytest.mark.parametrize("mirrors", ["y", "yz"])
def test_a_body_cut_at_mirrors_is_as_compliant_as_uncut(mirrors):
    """Elements alike on both sides of each plane: equal but for rounding of the solution."""
    assert compliance(mirrors) / compliance("") == pytest.approx(1, rel=1e-9)
    assert plate(mirrors)[2] / plate("")[2] == pytest.approx(1, rel=1e-9)


def test_a_part_between_mirrors_has_the_modes_that_the_contact_moves():
    """Lanczos leaves 1e-10 of an eigenvalue or so."""
    whole, quarter = (modes(plate(m)[0].K, plate(m)[0].M, 4, shift_hz=500.0) for m in ("", "yz"))
    moved = np.abs(whole.phi.T @ plate("")[1].w)
    first = int(np.argmax(moved))
    assert quarter.omega[0] == pytest.approx(whole.omega[first], rel=1e-7)
    assert abs(quarter.phi[:, 0] @ plate("yz")[1].w) == pytest.approx(moved[first], rel=1e-6)


def test_the_patch_folds_only_at_its_mirrors():
    """Its weights add up to one on any part; without the fold the disc leaves the quarter."""
    for mirrors in LOWER:
        assert plate(mirrors)[1].on_mesh.sum() == pytest.approx(-1.0, rel=1e-12)
    with pytest.raises(ValueError, match="leaves the face"):
        contact_patch(plate("yz")[0], "plate:+x", (-SIDE / 2, -SIDE / 2), RADIUS)


def test_a_half_space_needs_only_the_elements_near_the_patch():
    """Its exact field takes the place of the others: 4 mm elements over 30 mm leave 2e-4."""
    mesh = plate_mesh(0.05, Extent((0.0, 0.08), (0.0, 0.08)), seed=0.02, contact_seed=4e-3)
    faces = ["plate:-y", "plate:-z"]
    model = mirrored(assemble(by_body(mesh), {"plate": STEEL}), ["plate:-x"], faces)
    patch = contact_patch(model, "plate:+x", (-0.04, -0.04), RADIUS, mirrors="yz")
    whole, near, nearer = (
        half_space_on_mesh(model, "plate:+x", patch, STEEL, mirrors=faces, within=reach)
        for reach in (np.inf, 0.03, 0.012)
    )
    assert near / whole == pytest.approx(1, rel=2e-4)
    assert 5 * abs(near - whole) < abs(nearer - whole) < 0.02 * whole
