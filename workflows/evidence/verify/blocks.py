"""Blocks of hexahedra on given grid lines, as the comparisons of structures take them."""

import numpy as np
from skfem import MeshHex

from beadwave import fem


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
