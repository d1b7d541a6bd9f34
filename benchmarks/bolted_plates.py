"""Seconds of a contact under preload beside CalculiX's contact analysis on the same mesh.

You will see two plates of 180 x 80 x 10 mm, held at their ends, that six M8 bolts press: unknowns
and facets; seconds of the first contact (facets, factor with the compliance of the interface, zone,
friction), of further preloads, frictions and roughnesses, of the 24 lowest modes about one of them
beside those by a factor of its own, with what these differ by, and of six modes at twenty
amplitudes, also over the first contact. With `calculix` also those of CalculiX's static step from
surface to surface without friction, with one thread, of the processor and on the clock, and the sum
of its pressures, which tells whether it converged. Modes about the first state and the mesh's error
are not counted.

Run it: python benchmarks/bolted_plates.py [MESH.SCALE] [calculix]
"""

import sys
from os import times
from time import process_time

import numpy as np
from scipy.sparse import csr_matrix

from beadwave import fem
from beadwave.fem.assembly.rods import tightened
from beadwave.fem.contact.further_states import modes_about
from beadwave.fem.contact.modal_backbone import Loaded, friction_interface, modal_backbone
from beadwave.fem.contact.pressed_model import (
    PairInContact,
    pressed_assembly,
    pressed_model,
    pressed_state,
)
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.structure import assembly

from programs.calculix_contact import Layer, pressed

BOLTS = [[0.1, 0.02], [0.13, 0.02], [0.16, 0.02], [0.1, 0.06], [0.13, 0.06], [0.16, 0.06]]
SHIFT = 0.08  # m, of the second plate along x
# Pa/m of CalculiX's layer, a thirtieth of that here: with as stiff a one its pressures summed up to
# twice the force
LAYER = 1e15


def main(scale: float = 1.0, *, n_bolts: int = 6, calculix: bool = False) -> list[tuple]:
    """Print and return the rows: what was computed, and its seconds."""
    outline = [[0, 0], [0.18, 0], [0.18, 0.08], [0, 0.08]]
    at = {"left": BOLTS[:n_bolts], "right": [[x - SHIFT, y] for x, y in BOLTS[:n_bolts]]}
    bodies = {
        body: {
            "plate": {"outline": outline, "thickness": 0.01},
            "holes": {"diameter": 0.009, "at": holes},
        }
        for body, holes in at.items()
    }
    bodies["right"]["at"] = [SHIFT, 0.0, 0.01]
    joint = {"name": "lap", "between": "left|right", "bolt": "M8-8.8", "preload": 12e3}
    scene = resolved(
        {
            "name": "six-bolts",
            "assembly": {"held": ["left:-x", "right:+x"], "material": "steel", "touching": "free"},
            "mesh": {"scale": scale},
            "bodies": bodies,
            "joints": [joint | {"model": "contact"}],
        },
        "six-bolts.toml",
    )
    mesh = assembly.mesh(scene)
    structure = fem.assemble(mesh.meshes, mesh.materials)
    open_model = fem.joined(structure, mesh.assembled)
    bolts = [(place.centre, place.stiffness.slipped.kx) for place in mesh.bolted]
    (tie,) = mesh.contacts
    rows, started = [], process_time()

    def took(what: str) -> None:
        nonlocal started
        rows.append((what, process_time() - started))
        started = process_time()

    faces = [PairInContact(tie, 0.15, 0.0, bolts)]
    load = fem.Load(rods=mesh.rods)
    condensed = pressed_assembly(open_model, mesh.materials, load, faces)
    model = pressed_model(condensed, load, faces)
    took("first contact")
    F = open_model.T.T @ tightened(structure, mesh.rods).f
    others = [
        ("a further preload", 0.5, 0.15, 0.0), ("a further friction", 1.0, 0.3, 0.0),
        ("a further roughness", 1.0, 0.15, 1e-6),
    ]  # fmt: skip
    for what, share, friction, rough in others:
        pair = [PairInContact(tie, friction, rough, bolts)]
        locked = model.contact.locked
        pressed_state(condensed.contact, share * F, pair, condensed.of_each, locked)
        took(what)

    modes = fem.modes(model.K, model.M, 30)
    started = process_time()
    other = pressed_model(condensed, load, pair)
    further = modes_about(condensed, other, modes.phi, 24).modes
    took("the modes about that roughness")
    by_itself = fem.modes(other.K, other.M, 24)
    took("these by a factor of their own")
    differ = np.abs(further.omega - by_itself.omega) / by_itself.omega.max()
    rows.append(("the two differ by", differ.max()))
    started = process_time()

    interface, C = friction_interface(model)
    centres, facets = np.array([centre for centre, _ in bolts]), condensed.contact.facets
    groups = np.linalg.norm(facets.points[:, None] - centres, axis=2).argmin(axis=1)
    for phi, omega in zip(modes.phi.T[:6], modes.omega, strict=False):
        largest = float(np.linalg.norm((model.T @ phi).reshape(-1, 3), axis=1).max())
        loaded = Loaded(interface, csr_matrix(C) @ phi / omega**2, 1 / omega**2)
        modal_backbone(loaded, facets.area, groups, largest)
    took("six modes at twenty amplitudes")
    rows.append(("these over the first contact", rows[-1][1] / rows[0][1]))

    if calculix:
        F = tightened(structure, mesh.rods).f.reshape(-1, 3)
        F = np.where(np.abs(F) > 1e-12 * np.abs(F).max(), F, 0.0)
        theirs = pressed(open_model, dict(mesh.materials), tie[:2], F, Layer(LAYER))
        spent = times().children_user + times().children_system
        rows.append(("CalculiX, static step", spent))
        rows.append(("CalculiX, static step, on the clock", theirs.seconds))
        mean = np.array([np.mean(points) if points else 0.0 for points in theirs.pressure])
        force = sum(rod.tension for rod in mesh.rods)
        rows.append(("its pressures over the force of the bolts", facets.area @ mean / force))
    size = f"{open_model.K.shape[0]} unknowns, {len(facets.area)} facets"
    print(text(Table("seconds", (size, "seconds"), tuple(rows))))
    return rows


if __name__ == "__main__":
    sys.path.insert(0, __file__.rpartition("/")[0])
    scales = [float(word) for word in sys.argv[1:] if word != "calculix"]
    main(*scales, calculix="calculix" in sys.argv)
