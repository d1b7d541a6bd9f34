"""Contact of two faces in CalculiX (Debian: calculix-ccx), as an independent analysis: a static
step that presses them, surface to surface, and modes about that state."""

from os import environ
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.model import Model
from beadwave.fem.exchange.abaqus import ORDER, input_deck

from programs.calculix import PROGRAM

# corners of Abaqus' faces of a hexahedron, S1 to S6
FACES = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
Side = tuple[int, int]  # an element and its face


class Pressed(NamedTuple):
    """A contact analysis."""

    # at the closed points of each facet of the slave: pressure and size of the shear stress [Pa]
    pressure: list[list[float]]
    shear: list[list[float]]
    frequency_hz: NDArray[np.float64]  # (n_modes,) about the pressed state
    seconds: float


class Layer(NamedTuple):
    """The contact's law."""

    normal: float  # [Pa/m]
    across: float = 0.0  # [Pa/m] while it sticks
    friction: float = 0.0  # 0: none


def pressed(
    model: Model,
    materials: dict,
    faces: tuple[str, str],
    forces: NDArray[np.float64],
    layer: Layer,
    *,
    n_modes: int = 0,
) -> Pressed:
    """The faces "body:face", slave and master, of an open model of hexahedra pressed by forces
    (nodes, 3) [N]; raises ValueError where CalculiX gives up."""
    slave, sides = surface(model.structure, faces[0], "SLAVE")
    master, _ = surface(model.structure, faces[1], "MASTER")
    rubs = ["*FRICTION", f"{layer.friction:g}, {layer.across:g}"] if layer.friction else []
    contact = [
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{layer.normal:g}", *rubs,
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE",
        "SLAVE, MASTER",
    ]  # fmt: skip
    pushed = np.argwhere(forces)
    loads = [f"{node + 1}, {i + 1}, {forces[node, i]:.12e}" for node, i in pushed]
    step = ["*STEP", "*STATIC", "1., 1.", "*CLOAD", *loads]
    step += ["*CONTACT PRINT, SLAVE=SLAVE, MASTER=MASTER", "CSTR", "*END STEP"]
    if n_modes:
        step += ["*STEP, PERTURBATION", "*FREQUENCY", f"{n_modes}", "*END STEP"]
    deck = input_deck(model, materials).partition("*STEP\n")[0].rstrip()
    text = "\n".join([deck, *slave, *master, *contact, *step, ""])
    with TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(text)
        started = perf_counter()
        out = run(
            [PROGRAM, "deck"], cwd=folder, capture_output=True, text=True, timeout=3600,
            env=environ | {"OMP_NUM_THREADS": "1"},  # its threads spin where others want the cores
        )  # fmt: skip
        seconds = perf_counter() - started
        printed = (Path(folder) / "deck.dat").read_text()
    before, _, after = printed.partition("E I G E N V A L U E")
    static = before.rpartition("contact stress")[2]
    if not static.strip():
        raise ValueError(f"CalculiX gives up on this contact: {out.stdout[-1000:]}")
    points: dict[Side, list[list[float]]] = {}
    for line in static.splitlines():
        row = line.split()
        if len(row) >= 5 and row[0].isdigit():
            points.setdefault((int(row[0]), int(row[1])), []).append([float(x) for x in row[-3:]])
    # with friction the matrices are not symmetric, and no column has the eigenvalue
    rows = [line.split() for line in after.partition("E I G E N V A L U E")[0].splitlines()]
    hz = [float(row[-2]) for row in rows if len(row) in (4, 5) and row[0].isdigit()]
    of_facet = [points.get(side, []) for side in sides]
    pressure = [[p for p, *_ in row] for row in of_facet]
    shear = [[float(np.hypot(*tau)) for _, *tau in row] for row in of_facet]
    return Pressed(pressure, shear, np.array(hz[:n_modes]), seconds)


def surface(structure: Structure, face: str, name: str) -> tuple[list[str], list[Side]]:
    """*SURFACE of a face by its elements, and the elements and faces in the order of its facets."""
    body, facets = structure.facets(face)
    before = list(structure.basis)[: list(structure.basis).index(body)]
    first = sum(structure.basis[one].nelems for one in before)
    basis = structure.basis[body]
    mesh = basis.mesh
    corners = basis.element_dofs[0::3][ORDER["C3D20"][:8]]  # by their dofs
    sides = []
    for facet in facets:
        cell = mesh.f2t[0, facet]
        nodes = {basis.nodal_dofs[0, vertex] for vertex in mesh.facets[:, facet]}
        (side,) = (i for i, f in enumerate(FACES, 1) if {corners[k, cell] for k in f} == nodes)
        sides.append((int(first + cell + 1), side))
    lines = [f"{element}, S{side}" for element, side in sides]
    return [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *lines], sides
