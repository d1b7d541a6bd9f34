"""Scenes whose run would not end or would not fit into memory: refused before anything is computed.

A run's peak memory, stage upon stage, of bodies of N_i unknowns, N = sum N_i (bytes):

    libraries + matrices N + fill sum N_i^(4/3) + 8 N (vectors + boundary + modes)

for imported packages; K and M of bodies and assembly, and the arrays that they are made from; a
factor with its fronts, as nested dissection fills it in a solid; Lanczos vectors, constraint modes
and mode shapes. The runs of tests/workflows/test_memory.py, of 49 000 to a million unknowns, took
0.8 to 0.95 times as much. The time from mesh to reduced model on one core is

    start + solved N^(4/3),

since most of it is spent reading factors; models of 39 000 and 49 000 unknowns took 0.8 to 1.1
times as long.
"""

from collections.abc import Iterator
from importlib.util import find_spec
from math import log, pi
from typing import NamedTuple

from beadwave.system import free_memory
from beadwave.workflows.scene import Scene


class RunLimits(NamedTuple):
    """Largest requests of a scene; larger ones are refused. Chosen by the time that it takes on one
    core, not varied."""

    steps: float = 1e9  # of a march: minutes to hours
    values: float = 1e8  # of one saved quantity: 0.8 GB
    elements: float = 1e5  # of a mesh: a million unknowns, forty times the default
    modes: int = 2000  # of a wall: minutes to find, while a chain notices a few dozen
    error: float = 1e-9  # of a receptance, at least: some digits above rounding


# Coefficients of the memory [bytes] and the time [s] of a run, fitted to the runs named above.
LIBRARY_BYTES = 0.35e9  # of the imported packages
N_VECTORS = 40  # Lanczos vectors at a time
# of matrices for each unknown; an unknown of hexahedra is coupled to twice as many others
MATRIX_BYTES = {"hex": 11e3, "tet": 6e3}
# of factors, over N^(4/3): by our own Cholesky (False), by PARDISO (True)
FACTOR_BYTES = {False: 170.0, True: 240.0}
INSTANT_BYTES = 70  # of a saved instant of a sphere: 31 in a march, then errors and pictures
START_SECONDS = 2.0  # s
SOLUTION_SECONDS = 1.4e-5  # s, over N^(4/3)
# times that with bolts of a drawing, whose frequencies have three other sets of modes as limits and
# spreads: of three scenes of 34,000 to 72,000 unknowns, on springs and in contact, 2.4 to 3
BOUNDED = 2.6
# [s] more than that: of two plates of 1, 3 and 10 mm with 5,900 to 9,900 unknowns, in contact and
# on springs, 3 to 14 s were measured
BOUNDED_START = 6.0
# of `modes --amplitude` [s], beside those of the modes: steps of loops of six modes, and their rows
# of the interface's compliance; 156 to 1142 facets, 0.014 to 0.04 of the unknowns, took 9.5 to 18 s
LOOPS_START, LOOPS_OF_FACETS, FACETS = 10.0, 6e-6, 0.03
ELEMENT_GROWTH = (
    1.7  # of neighbouring elements away from the contact (`geometry.meshing.grid_lines`)
)


LIMITS = RunLimits()


def too_large(scene: Scene) -> Iterator[str]:
    """Sentences on keys that ask for more than a machine holds."""
    if scene.chain:
        yield from _too_long(scene)
    if scene.has_structure:
        yield from too_many_modes(scene)


def too_many_modes(scene: Scene) -> Iterator[str]:
    """Modes of a reduction, and the error that they are to reach."""
    reduction = scene.reduction
    if reduction.modes is not None and reduction.modes > LIMITS.modes:
        yield f"reduction.modes = {reduction.modes} must be up to {LIMITS.modes}; lower it."
    if reduction.error is not None and reduction.error < LIMITS.error:
        yield f"reduction.error = {reduction.error:g} must be at least {LIMITS.error:g}; raise it."


def _too_long(scene: Scene) -> Iterator[str]:
    """Steps and saved instants of the chain."""
    time, values = scene.time, scene.chain.count * scene.output.samples
    if time.dt is not None and time.duration > LIMITS.steps * time.dt:
        yield (
            f"time.dt = {time.dt} s makes {time.duration / time.dt:.1e} steps of time.duration = "
            f"{time.duration} s, allowed are {LIMITS.steps:.0e}; take a longer step or less time."
        )
    if values > LIMITS.values:
        yield (
            f"output.samples = {scene.output.samples} of chain.count = {scene.chain.count} spheres "
            f"are {values:.1e} values, allowed are {LIMITS.values:.0e}; lower one of them."
        )
    elif INSTANT_BYTES * values > free_memory():
        yield (
            f"output.samples = {scene.output.samples} of chain.count = {scene.chain.count} spheres "
            f"would take {gigabytes(INSTANT_BYTES * values)} of memory, "
            f"{gigabytes(free_memory())} "
            "are free; lower one of them."
        )


def foreseen_nodes(scene: Scene) -> dict[str, float]:
    """Nodes that the program's own mesh will have, by body: counted along prescribed grid lines,
    within a third for tetrahedra of boxes and plates; empty where only meshing tells."""
    from beadwave.geometry.meshing.node_estimate import n_nodes, n_nodes_of_tetrahedra
    from beadwave.workflows.scene.body_shapes import grid_lines, shapes

    scale, drawn, lines = scene.mesh.scale, shapes(scene), grid_lines(scene, scene.mesh.scale)
    seeds = {name: scene.seed_of(name) for name in drawn}
    if scene.assembly.file or None in seeds.values():
        return {}
    if lines:
        return {name: n_nodes(drawn[name], lines[name], scale * seeds[name]) for name in drawn}
    if scene.mesh.element != "tet":
        return {}
    strike = scene.strike
    return {
        name: n_nodes_of_tetrahedra(
            shape,
            scale * seeds[name],
            scale * strike.size if strike and strike.body == name else None,
        )
        for name, shape in drawn.items()
    }


def room_beside(scene: Scene, nodes: dict[str, float] | None = None) -> bool:
    """True if a process that compiles, estimates the mesh's error and draws the modes fits into
    memory next to a run; `nodes` of a mesh that is there."""
    nodes = nodes or foreseen_nodes(scene)
    n = 3.0 * sum(nodes.values())
    matrices = MATRIX_BYTES[scene.mesh.element] * n
    second = 2 * LIBRARY_BYTES + matrices + 8 * n * N_VECTORS
    return peak_memory(scene, nodes) + second < free_memory()


def too_large_mesh(scene: Scene, name: str, nodes: dict[str, float]) -> Iterator[str]:
    """A sentence on a mesh that is there, by its name and the nodes of its bodies."""
    needed, free = peak_memory(scene, nodes), free_memory()
    if needed > free:
        yield (
            f"{name} has {3 * sum(nodes.values()):.2g} unknowns, most of them in "
            f"{max(nodes, key=nodes.get)}, and a run would take {gigabytes(needed)} of memory, "
            f"{gigabytes(free)} are free; give a coarser mesh, and look at the lengths: a number "
            'without a unit is in metres, 8 mm are 0.008 or "8 mm".'
        )


def peak_memory(scene: Scene, nodes: dict[str, float]) -> float:
    """Bytes that a run will hold at most, of bodies with so many nodes."""
    bodies = [3.0 * n for n in nodes.values()]
    n = sum(bodies)
    fill = FACTOR_BYTES[find_spec("pypardiso") is not None] * sum(m ** (4 / 3) for m in bodies)
    strike = scene.strike
    radius, seed = (0.0, 1.0) if strike is None else (strike.radius, strike.size)
    across = log(1 + (ELEMENT_GROWTH - 1) * radius / seed, ELEMENT_GROWTH)  # elements of the patch
    boundary = 8 + 3 * pi * across**2
    vectors = N_VECTORS + boundary + (scene.reduction.modes or 40)
    return LIBRARY_BYTES + MATRIX_BYTES[scene.mesh.element] * n + fill + 8 * n * vectors


def foreseen_seconds(nodes: dict[str, float], *, bounded: bool = False) -> float:
    """Seconds of mesh, modes and reduction on one core, within a factor of 2; with `bounded` those
    of the limits and spreads of bolted joints too."""
    solution = SOLUTION_SECONDS * (3.0 * sum(nodes.values())) ** (4 / 3)
    if bounded:
        return START_SECONDS + BOUNDED_START + BOUNDED * solution
    return START_SECONDS + solution


def foreseen_loop_seconds(nodes: dict[str, float]) -> float:
    """Seconds on one core that `modes --amplitude` takes beyond the modes, within a factor of 2."""
    return LOOPS_START + LOOPS_OF_FACETS * (FACETS * 3.0 * sum(nodes.values())) ** 2


def gigabytes(n_bytes: float) -> str:
    return f"{n_bytes / 1e9:.3g} GB"
