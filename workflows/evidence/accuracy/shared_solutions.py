"""Factorisations and solutions that several reductions need, computed once and counted each time.

Krylov and Lanczos spaces of one structure begin alike, so most of what a larger reduction solves
a smaller one has solved. A right-hand side that was met before gets its solution from a store, and
the seconds that it took are added to `saved`: what a reduction would take by itself is its own
time and what it saved.
"""

from hashlib import blake2b
from time import process_time

import numpy as np

from beadwave.fem.modes.solver.factorisation import factorised


class SharedSolutions:
    """Called with a matrix it returns a factor, as `factorised`; saved [s] of the processor.

    Every solution is held as long as this object: some hundred vectors (n,) of one structure.
    """

    def __init__(self) -> None:
        self.saved = 0.0
        self._known: dict[bytes, tuple[object, float]] = {}

    def __call__(self, A):
        """A factor of A whose solutions are shared."""
        key = _digest(A.data, A.indices, A.indptr)
        return _Factor(self, key, self.once(key, lambda: factorised(A)))

    def once(self, key: bytes, computed):
        """The result of `computed`, from the store if it was computed before."""
        if key in self._known:
            result, seconds = self._known[key]
            self.saved += seconds
            return result
        started = process_time()
        result = computed()
        self._known[key] = result, process_time() - started
        return result


class _Factor:
    """A factor that looks a right-hand side up by its digest before it solves."""

    def __init__(self, shared: SharedSolutions, key: bytes, factor) -> None:
        self._shared, self._key, self._factor = shared, key, factor

    def solve(self, b: np.ndarray) -> np.ndarray:
        """x of A x = b, (n,) or (n, k); a copy, which its caller may write over."""
        key = _digest(self._key, b)
        x = self._shared.once(key, lambda: self._factor.solve(b)).copy(order="K")
        return x.reshape(b.shape)  # (n,) and (n, 1) have one digest


def _digest(*arrays) -> bytes:
    """128 bits of the arrays' content, bit by bit: right-hand sides that differ by rounding are
    two."""
    digest = blake2b(digest_size=16)
    for array in arrays:
        content = array if isinstance(array, bytes) else np.ascontiguousarray(array)
        digest.update(content)
    return digest.digest()
