"""Chains and structures that several tests know the answers of."""

import numpy as np
import scipy.sparse as sp
from skfem import Basis

from beadwave.dem import Chain
from beadwave.fem import BodyMotion, Material, assemble
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.structure.assembly import mesh

YOUNG, DENSITY = 210e9, 7850.0
STEEL = Material(YOUNG, 0.3, DENSITY)


def unit_chain(n, A_wall=None, **parts):
    """Spheres of mass 1 and diameter 1, contacts of A = 1; at a wall where A_wall is given."""
    A = np.ones(n - 1 if A_wall is None else n)
    if A_wall is not None:
        A[-1] = A_wall
    return Chain(np.ones(n), np.full(n, 0.5), A, **parts)


def speeds(n, speed=1.0):
    """Velocities (n,) with only the striker moving."""
    return speed * np.eye(1, n)[0]


def steel_bar(area, n=120, length=0.5, held=True):
    """K, M of n lumped masses and w that strikes the far end."""
    h = length / n
    diagonal = np.full(n, 2.0)
    diagonal[-1] = 1
    diagonal[0] = 2 if held else 1
    chain = sp.diags_array([-np.ones(n - 1), diagonal, -np.ones(n - 1)], offsets=[-1, 0, 1])
    M = DENSITY * area * h * sp.diags_array(np.r_[np.ones(n - 1), 0.5])
    return (YOUNG * area / h * chain).tocsc(), M.tocsc(), np.eye(n)[-1]


def at(z):
    """Facets at a height."""
    return lambda x: np.abs(x[2] - z) < 1e-9


def stacked(lower, upper, height, gap=0.0):
    """Structure of a steel body on another that ends at `height` [m], `gap` [m] between them."""
    lower = lower.with_boundaries({"base": at(0.0), "top": at(height)})
    meshes = {"lower": lower, "upper": upper.with_boundaries({"foot": at(height + gap)})}
    return assemble(meshes, dict.fromkeys(meshes, STEEL))


RIG_TARGETS = tuple(BodyMotion("block", motion) for motion in ("y", "x+ry", "rz", "strain"))


def rig(*changes, of="rig-rom"):
    """The thesis' rig of a built-in scene, meshed, and what joins and holds it."""
    return mesh(scene(of, changes))


def steel(bodies):
    """One steel for all bodies."""
    return dict.fromkeys(bodies, STEEL)


# a block on another, two elastic pads between them and a sensor on top: meshed in a second
PADS = """
assembly = { held = ["base:-z"], material = "steel", touching = "free" }
[bodies.base]
box = [0.06, 0.04, 0.02]
seed = 0.02
[bodies.block]
box = [0.06, 0.04, 0.02]
seed = 0.02
at = [0.0, 0.0, 0.02]
[[joints]]
name = "pads"
between = "block|base"
at = [[-0.02, 0.0, 0.01], [0.02, 0.0, 0.01]]
washer = 0.008
kz = 1e7
kx = 3e8
krx = 500.0
krz = 500.0
[[masses]]
name = "sensor"
on = "block:+z"
mass = 0.02
radius = 0.008
"""


def facet_error(mesh, body):
    """Volume of the mesh over that of the body, less 1: the error of its straight facets."""
    return float(Basis(mesh, mesh.elem(), intorder=3).dx.sum() / body.volume - 1)
