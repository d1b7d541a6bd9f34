"""Threads of dense products: of many small ones they wait for each other longer than they work.

On two cores that others use as well a factor of blocks of some hundred rows took ten times as long
with two threads as with one.
"""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """While it lasts numpy and scipy multiply in one thread; PARDISO keeps its own."""
    return _pools().limit(limits=1)


@cache
def _pools() -> ThreadpoolController:
    return ThreadpoolController().select(internal_api="openblas")
