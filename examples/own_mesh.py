"""A chain against a structure of one's own mesh: K, M and w in, an impact out.

You will see the largest force on a steel block of 40 x 60 x 60 mm, clamped at its back, beside that
on a rigid wall of the same steel surface; the block gives way and sends back less.

    chain ooooooo>|######|/     u_w = w . u, the mean of the patch;  f = w F
                  |######|/     K u + M u'' = w F

Run it: python examples/own_mesh.py
"""

import numpy as np
from skfem import MeshHex

import beadwave
from beadwave import fem

STEEL = fem.Material(young=210e9, poisson=0.3, density=7850.0)
PATCH = 3e-3  # [m] radius of the disc that is pushed and read


def block(n: int = 6) -> MeshHex:
    """Hexahedra; its faces are named, block:front elsewhere."""
    across = np.linspace(-0.03, 0.03, n + 1)
    mesh = MeshHex.init_tensor(np.linspace(0.0, 0.04, n + 1), across, across)
    return mesh.with_boundaries({"front": lambda x: x[0] == 0.0, "back": lambda x: x[0] == 0.04})


def reduced():
    """The block in 20 modes and a residual vector at the patch."""
    structure = fem.assemble({"block": block()}, {"block": STEEL})
    model = fem.joined(structure, fem.Connections(held=[fem.HeldFace("block:back")]))
    patch = fem.contact_patch(model, "block:front", (0.0, 0.0), PATCH)
    local = fem.half_space_on_mesh(model, "block:front", patch, STEEL)
    return beadwave.reduce_matrices(
        model.K, model.M, patch.w, modes=20, half_space=local, young=210e9, poisson=0.3
    )


if __name__ == "__main__":
    for wall in (reduced(), None):
        result = beadwave.impact("rig-rigid", {"time.duration": 2e-3}, rom=wall)
        print(f"{'rigid' if wall is None else 'block':6}{result.summary.peak_wall_force_N:8.1f} N")
