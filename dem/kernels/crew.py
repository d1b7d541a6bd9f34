"""Threads that march one system together, each its share, and wait for each other in between.

A thread that is first spins, and gives its core away where others are long in coming: a step of
some thousand contacts takes less than to wake a thread that sleeps.
"""

import os
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.kernels.compiled import ieee

SPINS = 2000  # some microseconds; not varied
ARRIVED, ROUNDS, STOPPED = range(3)  # of `Crew.gate`


class Crew(NamedTuple):
    """One of some threads."""

    worker: int  # from 0
    workers: int
    gate: NDArray[np.int64]  # (3,) arrived at this round, rounds so far, an end before the last


class Primitive:
    """An instruction of the processor that Python lacks: `define(typing context, types)` gives
    numba its signature and code, the Python function is what it does for one thread alone."""

    def __init__(self, alone: Callable, define: Callable) -> None:
        self.alone, self.define = alone, define

    @cached_property
    def _numba_type_(self):
        from numba.core.registry import cpu_target
        from numba.extending import intrinsic

        function, context = intrinsic(self.define), cpu_target.typing_context
        context.refresh()  # knows the function from here on
        return context.resolve_value_type(function)

    def __call__(self, *arguments):
        return self.alone(*arguments)


def _add_alone(values: NDArray[np.int64], i: int, n: int) -> int:
    values[i] += n
    return int(values[i] - n)


def _add(context, values, i, n):
    from numba.core import cgutils, types

    def code(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        place = cgutils.get_item_pointer(
            context, builder, signature.args[0], array, [arguments[1]], wraparound=False
        )
        return builder.atomic_rmw("add", place, arguments[2], "seq_cst")

    return types.int64(values, types.intp, types.int64), code


def _yield(context):
    from llvmlite import ir
    from numba.core import cgutils, types

    def code(context, builder, signature, arguments):
        if os.name == "posix":
            kind = ir.FunctionType(ir.IntType(32), [])
            builder.call(cgutils.get_or_insert_function(builder.module, kind, "sched_yield"), [])
        return context.get_dummy_value()

    return types.void(), code


# values[i] += n [int64], seen by all threads at once: what was there before
add = Primitive(_add_alone, _add)
# the core to another thread that waits for one
give_way = Primitive(lambda: None, _yield)


@ieee
def meet(crew: Crew) -> None:
    """Wait until all threads are here; what they wrote before is there for all after."""
    if crew.workers == 1:
        return
    gate, spins = crew.gate, 0
    now = add(gate, ROUNDS, 0)
    if add(gate, ARRIVED, 1) == crew.workers - 1:
        add(gate, ARRIVED, -crew.workers)
        add(gate, ROUNDS, 1)
    else:
        while add(gate, ROUNDS, 0) == now:
            spins += 1
            if spins > SPINS:
                give_way()


@ieee
def share(n: int, crew: Crew) -> tuple[int, int]:
    """First of n things that are this thread's, and the first of the next thread.

    Loops over them run from 0 on and leave out what is below: by a range that begins at a variable
    each index is tested for a negative one, which took a fifth of a frictionless step.
    """
    return n * crew.worker // crew.workers, n * (crew.worker + 1) // crew.workers
