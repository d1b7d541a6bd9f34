"""Two boxes of different cells in a mesh file of the user's own, and a scene on it."""

import meshio
import numpy as np

SCENE = """
materials.steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }}
strike = {{ on = "{top}:+z", at = [0.01, 0.0] }}
[assembly]
material = "steel"
held = ["base:-z"]
{words}
"""


def boxes(path, *, names=("base", "cover"), at=0.0, lift=0.0, scale=1.0):
    """Hexahedra below, tetrahedra of another size above, in any of meshio's formats with sets."""
    from skfem import MeshHex, MeshTet
    from skfem.io.meshio import HEX_MAPPING

    x = np.linspace(0, 0.04, 5)
    low, high = MeshHex.init_tensor(x, x, x[:3]), MeshTet.init_tensor(x[:4], x[:3], x[:3] / 2)
    points = np.vstack([low.p.T, high.p.T + [at, 0.0, 0.02 + lift]]) * scale
    cells = [("hexahedron", low.t[HEX_MAPPING[:8]].T), ("tetra", high.t.T + low.p.shape[1])]
    first, second = np.arange(low.nelements), np.arange(high.nelements)
    sets = dict(zip(names, ([first, second[:0]], [first[:0], second]), strict=True))
    meshio.Mesh(points, cells, cell_sets=sets).write(path)
