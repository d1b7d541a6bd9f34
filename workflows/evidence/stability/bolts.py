"""Faces pressed by a bolt: friction, preload and thickness at their extremes."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from skfem import MeshHex

from beadwave import fem
from beadwave.fem.assembly.rods import tightened
from beadwave.fem.contact.preloaded_contact import OPEN
from beadwave.fem.contact.pressed_model import (
    SHIFT,
    PairInContact,
    pressed_assembly,
    pressed_model,
)
from beadwave.workflows.evidence.harness import Outcome, Trial

STEEL = fem.Material(210e9, 0.3, 7850.0)
SIDE, HALF_HEAD = 0.06, 0.01  # m, of the plates and of the squares under head and nut


def pressed_faces() -> Iterator[Trial]:
    """Friction 0 and 1, preload 1 N to 1 MN, plates one element and a tenth of a millimetre thick.

    Of two free plates on meshes that do not match: the force in the faces beside the preload, the
    balance of forces, faces that overlap or pull, friction beyond its bound, and the six rigid
    motions, which pressure and tension leave at rest.
    """
    for friction in (0.0, 0.15, 1.0):
        yield Trial(f"friction {friction:g}", partial(two_plates, friction=friction))
    for preload in (1.0, 1e3, 1e6):
        yield Trial(f"preload {preload:g} N", partial(two_plates, preload=preload))
    for thickness, layers in ((0.01, 1), (1e-3, 1), (1e-4, 1)):
        # a bolt that thin plates bear: of as much pressure over their thickness
        preload = 1e4 * (thickness / 0.01) ** 2
        name = f"{1e3 * thickness:g} mm, {layers} element thick"
        yield Trial(name, partial(two_plates, preload=preload, thickness=thickness, layers=layers))


def two_plates(
    *, friction: float = 0.15, preload: float = 1e4, thickness: float = 0.01, layers: int = 2
) -> Outcome:
    """The largest relative error of two free plates that a bolt presses."""
    meshes = {}
    for body, n, z in (("a", 6, -thickness), ("b", 9, 0.0)):
        x = np.linspace(-SIDE / 2, SIDE / 2, n + 1)
        mesh = MeshHex.init_tensor(x, x, np.linspace(z, z + thickness, layers + 1))
        outer = z if body == "a" else z + thickness
        meshes[body] = mesh.with_boundaries(
            {
                "inner": lambda p: np.abs(p[2]) < 1e-3 * thickness,
                "head": lambda p, at=outer: (
                    (np.abs(p[2] - at) < 1e-3 * thickness) & (np.abs(p[:2]).max(axis=0) < HALF_HEAD)
                ),
            }
        )
    structure = fem.assemble(meshes, dict.fromkeys(meshes, STEEL))
    open_model = fem.joined(structure, fem.Connections())
    load = fem.Load(rods=[fem.Rod("a:head", "b:head", preload, 1e8)])
    bolts = [(np.zeros(3), 1e7)]
    faces = [PairInContact(fem.Tie("b:inner", "a:inner"), friction, 0.0, bolts)]
    assembly = pressed_assembly(open_model, dict.fromkeys(meshes, STEEL), load, faces)
    model = pressed_model(assembly, load, faces)
    state = model.contact

    # without friction K u = F + C^T P; faces neither overlap nor pull
    m, P = len(state.pressure), state.pressure * state.facets.area
    F = open_model.T.T @ tightened(structure, load.rods).f
    left = open_model.K @ state.u + SHIFT * (open_model.M @ state.u)
    left -= F + assembly.contact.C[:m].T @ (state.smooth_pressure * state.facets.area)
    layer = state.hard * state.facets.area
    moved = np.abs(state.u).max()
    on = state.state != OPEN
    overlap = np.where(on, state.gap + P / layer, np.minimum(state.gap, 0.0))
    beyond = np.hypot(*state.shear) - friction * P

    omega = fem.modes(model.K, model.M, 7).omega
    errors = {
        "force": abs(state.force / preload - 1),
        "balance": np.linalg.norm(left) / np.linalg.norm(F),
        "overlap": np.abs(overlap).max() / moved,
        "pull": max(-P.min(), 0.0) / preload,
        "friction": max(beyond.max(), 0.0) / preload,
        "rigid motions": (omega[5] / omega[6]) ** 2,
    }
    return Outcome(float(max(errors.values())), 1e-5)
