"""The number of threads of dense products: threads of many small products mostly wait.

On two cores that others use as well a factor of blocks of some hundred rows took ten times as long
with two threads as with one.
"""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """Lets numpy and scipy multiply in one thread while the context lasts; PARDISO keeps
    its own."""
    return _pools().limit(limits=1)


@cache
def _pools() -> ThreadpoolController:
    return ThreadpoolController().select(internal_api="openblas")
