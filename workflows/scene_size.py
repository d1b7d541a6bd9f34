"""Scenes whose run would not end or not fit into memory, told before anything is computed."""

from math import log, pi, prod

from workflows.scene import Scene

MOST_STEPS = 1e9  # minutes to hours
MOST_VALUES = 1e8  # of one saved quantity: 0.8 GB
MOST_ELEMENTS = 1e5  # a million unknowns, forty times the default
MOST_MODES = 2000  # of a wall: minutes to find, and a chain notices a few dozen
LEAST_ERROR = 1e-9  # of a receptance, some digits above rounding
GROWTH = 1.7  # of neighbouring elements away from the contact


def too_large(scene: Scene):
    """Sentences on keys that ask for more than a machine holds."""
    if scene.chain:
        yield from _too_long(scene)
    if scene.assembly is not None:
        yield from _too_fine(scene)
        yield from _too_many_modes(scene)


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


def _solids(a) -> list[float]:
    """Volumes [m^3] of the block and of what stands below it."""
    sizes = [(a.block_x, a.block_y, a.block_z)]
    sizes += [(a.sheets_support_x, a.sheets_support_y, a.sheets_support_z)]
    sizes += [(a.support_x, a.support_y, a.support_z), (a.plate_x, a.plate_y, a.plate_z)]
    return [prod(size) for size in sizes]


def _too_many_modes(scene: Scene):
    a, table = scene.assembly, scene.reduction
    # modes of a solid below f: 4/3 pi V f^3 (1/c_L^3 + 2/c_T^3), the first term a tenth (Weyl)
    c_T = (a.young / (2 * (1 + a.poisson)) / a.density) ** 0.5
    highest = (MOST_MODES * c_T**3 / (4 / 3 * pi * 2.2 * sum(_solids(a)))) ** (1 / 3)
    for key in ("cutoff", "to_hz"):
        asked = getattr(table, key)
        if asked is not None and asked > highest:
            yield (
                f"reduction.{key} = {asked:g} Hz must be up to {highest:.3g} Hz, below which the "
                f"assembly has some {MOST_MODES} modes; lower it."
            )
    if table.modes is not None and table.modes > MOST_MODES:
        yield f"reduction.modes = {table.modes} must be up to {MOST_MODES}; lower it."
    if table.error is not None and table.error < LEAST_ERROR:
        yield f"reduction.error = {table.error:g} must be at least {LEAST_ERROR:g}; raise it."


def _too_fine(scene: Scene):
    a, mesh = scene.assembly, scene.mesh
    length = a.head_overlap + a.sheet_free_length + a.foot_overlap
    block, *below = _solids(a)
    elements = {
        "block_seed": block / mesh.block_seed**3,
        "seed": 2 * length * a.sheet_width / mesh.seed**2,
        "contact_seed": 4 * (1 + log(max(1, mesh.block_seed / mesh.contact_seed), GROWTH)) ** 3,
        "support_seed": sum(below) / mesh.support_seed**3,
    }
    for key, number in elements.items():
        if number > MOST_ELEMENTS:
            yield (
                f"mesh.{key} = {getattr(mesh, key)} m makes {number:.1e} elements, allowed are "
                f"{MOST_ELEMENTS:.0e}; take a larger one."
            )
