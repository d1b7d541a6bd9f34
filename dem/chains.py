"""Chains of a batch: equal in length and wall modes, different in everything else."""

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import PER_SPHERE, Chain, validate
from beadwave.dem.checks import InvalidChain
from beadwave.dem.elastic import ElasticLaw
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.statics import approach, static_state
from beadwave.dem.walls import Wall

# fields that may differ from chain to chain: numbers of a chain and of a wall, arrays of a wall;
# those of the spheres and contacts are PER_SPHERE
PER_CHAIN = ("preload", "gravity")
PER_WALL = ("residual_compliance", "mobility")
PER_MODE = ("omega", "zeta", "phi")


class Chains:
    """Chains of a batch with their walls and initial velocities.

    Fields of chain and wall and v0 have a leading axis n_chains, or lack it and are shared;
    preload, gravity, residual compliance and mobility are scalars or one per chain, the name of
    the dissipation and the number of spheres in flight are shared. `chains[i]` is the i-th chain
    with its wall and velocities; `chains.mass` and the other fields are arrays (n_chains, ...).
    Raises InvalidChain.
    """

    def __init__(self, chain: Chain, wall: Wall | None, v0: ArrayLike) -> None:
        self.chain, self.wall = chain, wall
        fields = _fields(chain, PER_CHAIN, PER_SPHERE) | {"v0": (np.asarray(v0, float), 2)}
        if wall is not None:
            fields |= _fields(wall, PER_WALL, PER_MODE)
        counts = {
            name: values.shape[0] for name, (values, axes) in fields.items() if values.ndim == axes
        }
        self.count = max(counts.values(), default=1)
        for name, count in counts.items():
            if count not in (1, self.count):
                raise InvalidChain(
                    f"{name} is given for {count} chains, others for {self.count}; give as many"
                )
        self.arrays = {
            name: np.broadcast_to(values, (self.count, *values.shape[values.ndim - axes + 1 :]))
            for name, (values, axes) in fields.items()
        }

        # the first and the last chain are checked in full, the others as far as whole arrays can be
        for i in {0, self.count - 1}:
            validate(*self[i])
        bad = [name for name, values in self.arrays.items() if not np.isfinite(values).all()]
        if bad or (self.arrays["A"] <= 0).any() or (self.arrays["mass"] <= 0).any():
            raise InvalidChain(
                f"a chain of the batch has {bad[0] if bad else 'a mass or A'} that is not finite "
                "or not above 0"
            )

    def __getitem__(self, i):
        fields = {name: values[i].copy() for name, values in self.arrays.items()}
        v0 = fields.pop("v0")
        steady = {name: float(fields.pop(name)) for name in PER_CHAIN}
        numbers = {name: float(fields.pop(name)) for name in PER_WALL if name in fields}
        modes = {name: fields.pop(name) for name in PER_MODE if name in fields}
        chain = self.chain._replace(**fields, **steady)
        wall = None if self.wall is None else self.wall._replace(**modes, **numbers)
        return chain, wall, v0

    def __getattr__(self, name):
        return self.arrays[name]

    @property
    def fit_lanes(self) -> bool:
        """True if the kernel for chains side by side has all parts of these: no yield, no friction,
        no dashpot."""
        creeps = np.any(self.arrays.get("mobility", 0.0))
        return not (creeps or self.chain.yield_overlap is not None or self.chain.slides)

    @property
    def elastic(self) -> ElasticLaw:
        """The elastic law of the contacts, (n_chains, n_contacts)."""
        parameters = {name: self.arrays[name] for name in self.chain.elastic.parameters}
        return ElasticLaw(self.A, parameters, self.chain.table)

    @property
    def free(self) -> bool:
        """True if the last sphere has no wall."""
        return self.wall is None

    @property
    def damped(self) -> bool:
        """True if any contact dissipates."""
        return self.chain.dissipation != "none" and bool(self.gamma.any())

    @property
    def most_damped(self) -> int:
        """Index of the chain with the largest coefficient, 0 where none has any."""
        return int(self.gamma.max(axis=1).argmax()) if self.damped else 0

    @cached_property
    def static(self) -> tuple[Array, Array, Array]:
        """Static states: positions (n_chains, n), contact forces (n_chains, n_contacts) and
        displacements of the wall's modes (n_chains, n_modes)."""
        preload, phi = self.preload, self.arrays.get("phi")
        springs = self.arrays.get("leaf_stiffness")
        if not (preload.any() or np.any(springs) or self.gravity.any()):
            modes = np.zeros((self.count, 0 if phi is None else phi.shape[1]))
            return np.zeros_like(self.mass), np.zeros_like(self.A), modes

        # a preload alone presses the last sphere on its wall, the others just touch
        only_preload = not (self.free or np.any(springs) or self.gravity.any())
        if only_preload and not ((preload < 0.0).any() or (self.omega == 0).any()):
            response = phi / self.omega**2
            compliance = (phi * response).sum(axis=1) + self.residual_compliance
            x = approach(self.elastic.at(-1), preload, compliance)[:, None]
            at_wall = np.arange(self.mass.shape[1]) == self.mass.shape[1] - 1
            if (compliance >= 0.0).all():
                return x + 0.0 * self.mass, preload[:, None] * at_wall, response * preload[:, None]

        static = [static_state(*self[i][:2]) for i in range(self.count)]
        return tuple(np.array(values) for values in zip(*static, strict=True))

    def take(self, rows: Array) -> "Chains":
        """The chains of these rows (m,), indices that may come more than once; not validated again,
        and with the static states that were found before."""
        chains = object.__new__(Chains)
        chains.chain, chains.wall, chains.count = self.chain, self.wall, len(rows)
        chains.arrays = {name: values[rows] for name, values in self.arrays.items()}
        if "static" in self.__dict__:
            chains.__dict__["static"] = tuple(values[rows] for values in self.static)
        return chains


def _fields(
    owner: NamedTuple, numbers: Iterable[str], vectors: Iterable[str]
) -> dict[str, tuple[Array, int]]:
    """Values of the fields that are not None, and how many axes they have where chains differ."""
    axes = dict.fromkeys(numbers, 1) | dict.fromkeys(vectors, 2)
    return {
        name: (np.asarray(getattr(owner, name), float), n)
        for name, n in axes.items()
        if getattr(owner, name) is not None
    }
