"""A march leaves the same bits wherever its arrays lie in memory.

Sums of compiled loops may be taken in any order, and machine code has two loops where arrays that
it writes might overlap those that it reads: a wide one, and one number after the other. Which of
them is taken must not depend on what the allocator puts beside an array.
"""

import numpy as np
import pytest

from beadwave import dem
from beadwave.dem.kernels.compiled import CompiledFunction
from beadwave.dem.sensitivities import march_with_sensitivities

MODES = 30  # enough for the wide loop
RNG = np.random.default_rng(0)
WALL = dem.Wall(np.sort(RNG.uniform(1e3, 1e6, MODES)), np.full(MODES, 0.01), RNG.normal(size=MODES))
CHAIN = dem.row_of_spheres(0.0095, 7800.0, 210e9, 0.3, count=9)
V0 = np.r_[0.45, np.zeros(8)]
SPAN = {"duration": 2e-4, "dt": 4e-7}


def owner(array):
    """The array whose memory this one is a part of."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def arrays_in(arguments):
    if isinstance(arguments, np.ndarray):
        yield arguments
    elif isinstance(arguments, tuple):
        for argument in arguments:
            yield from arrays_in(argument)


def elsewhere(call_kernel, rng):
    """Calls a kernel with its arrays side by side in one piece of memory, in any order."""

    def call(kernel, *arguments):
        owners = {owner(a).ctypes.data: owner(a) for a in arrays_in(arguments) if a.size}
        starts, end = {}, 0
        for data in rng.permutation(list(owners)):
            starts[int(data)] = end
            end += -(-owners[data].nbytes // 16) * 16 + 16 * int(rng.integers(1, 40))
        memory = np.empty(end, np.uint8)

        def moved(argument):
            if isinstance(argument, tuple):
                values = map(moved, argument)
                return type(argument)(*values) if hasattr(argument, "_fields") else tuple(values)
            if not isinstance(argument, np.ndarray) or not argument.size:
                return argument
            data = owner(argument).ctypes.data
            offset = starts[data] + argument.ctypes.data - data
            return np.ndarray(argument.shape, argument.dtype, memory, offset, argument.strides)

        places = [(moved(whole), whole) for whole in owners.values()]
        for place, whole in places:
            place[...] = whole
        result = call_kernel(kernel, *map(moved, arguments))
        for place, whole in places:
            if whole.flags.writeable:
                whole[...] = place
        return result

    return call


def marched(chain=CHAIN, wall=WALL, **options):
    run = dem.march(chain, wall, V0, n_save=100, **SPAN, **options)
    return run.v, run.wall_x, run.energy_total


def side_by_side():
    v0 = np.outer([0.3, 0.45], V0 / V0[0])
    batch = dem.march_batch(dem.Chains(CHAIN, WALL, v0), n_save=100, **SPAN)
    return batch.v, batch.wall_force


def with_derivatives():
    run = march_with_sensitivities(CHAIN, WALL, V0, observed=[4, 8], **SPAN)
    return run.at(np.linspace(0.0, 2e-4, 50))[:2]


MARCHES = {
    **{scheme: lambda scheme=scheme: marched(scheme=scheme) for scheme in dem.SCHEMES},
    "residual": lambda: marched(wall=WALL._replace(residual_compliance=1e-9)),
    "dashpot": lambda: marched(wall=WALL._replace(residual_compliance=1e-9, mobility=1e-6)),
    "preload": lambda: marched(CHAIN._replace(preload=20.0)),
    "gravity": lambda: marched(CHAIN._replace(gravity=9.81)),
    "damped": lambda: marched(CHAIN._replace(gamma=np.full(9, 0.3))),
    "friction": lambda: marched(CHAIN._replace(friction=np.full(9, 0.01))),
    "to an error": lambda: dem.march_to_error(
        CHAIN, WALL, V0, duration=2e-4, error=1e-4
    ).trajectory[1:6],
    "side by side": side_by_side,
    "with derivatives": with_derivatives,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MARCHES)
def test_a_march_leaves_the_same_bits_wherever_its_arrays_lie(name, monkeypatch):
    """With modes right behind their propagators one march of ten was summed otherwise."""
    usual = MARCHES[name]()
    call, rng = CompiledFunction.__call__, np.random.default_rng(1)
    for _ in range(30):
        with monkeypatch.context() as patch:
            patch.setattr(CompiledFunction, "__call__", elsewhere(call, rng))
            other = MARCHES[name]()
        for one, two in zip(usual, other, strict=True):
            np.testing.assert_array_equal(one, two)
