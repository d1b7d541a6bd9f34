"""Scenes whose run would not end or not fit into memory, told before anything is computed."""

from math import log, prod

from workflows.scene import Scene

MOST_STEPS = 1e9  # minutes to hours
MOST_VALUES = 1e8  # of one saved quantity: 0.8 GB
MOST_ELEMENTS = 1e5  # a million unknowns, forty times the default
GROWTH = 1.7  # of neighbouring elements away from the contact


def too_large(scene: Scene):
    """Sentences on keys that ask for more than a machine holds."""
    if scene.chain:
        yield from _too_long(scene)
    if scene.assembly is not None:
        yield from _too_fine(scene)


def _too_long(scene: Scene):
    time, values = scene.time, scene.chain.count * scene.output.samples
    if time.dt is not None and time.duration > MOST_STEPS * time.dt:
        yield (
            f"time.dt = {time.dt} s makes {time.duration / time.dt:.1e} steps of time.duration = "
            f"{time.duration} s, allowed are {MOST_STEPS:.0e}; take a longer step or less time."
        )
    if values > MOST_VALUES:
        yield (
            f"output.samples = {scene.output.samples} of chain.count = {scene.chain.count} spheres "
            f"are {values:.1e} values, allowed are {MOST_VALUES:.0e}; lower one of them."
        )


def _too_fine(scene: Scene):
    a, mesh = scene.assembly, scene.mesh
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    below = [(a.sheets_support_x, a.sheets_support_y, a.sheets_support_z)]
    below += [(a.support_x, a.support_y, a.support_z), (a.plate_x, a.plate_y, a.plate_z)]
    elements = {
        "block_seed": prod((a.block_x, a.block_y, a.block_z)) / mesh.block_seed**3,
        "seed": 2 * length * a.sheet_width / mesh.seed**2,
        "contact_seed": 4 * (1 + log(max(1, mesh.block_seed / mesh.contact_seed), GROWTH)) ** 3,
        "support_seed": sum(map(prod, below)) / mesh.support_seed**3,
    }
    for key, number in elements.items():
        if number > MOST_ELEMENTS:
            yield (
                f"mesh.{key} = {getattr(mesh, key)} m makes {number:.1e} elements, allowed are "
                f"{MOST_ELEMENTS:.0e}; take a larger one."
            )
