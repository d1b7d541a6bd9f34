"""A chain and its wall prepared for a march: what does not depend on the step."""

from typing import NamedTuple

import numpy as np

from beadwave.dem.chain import Chain
from beadwave.dem.checks import InvalidChain
from beadwave.dem.kernels.arguments import Array, Damping
from beadwave.dem.kernels.laws import DAMPING_LAWS
from beadwave.dem.statics import Equilibrium, static_state
from beadwave.dem.walls import Wall


class PreparedChain(NamedTuple):
    """A validated chain and its wall, with what follows from them."""

    chain: Chain
    wall: Wall | None
    static: Equilibrium
    load: Array | None  # (n,) [N] steady forces that balance the contacts at rest; None for none
    damping: Damping | None

    @property
    def pressed(self) -> Array:
        """(n_contacts,) [N] static forces, and the most that spheres in flight add by weight."""
        return self.static.force + 2.0 * abs(self.chain.steady[: self.chain.n_falling].sum())


def prepare(chain: Chain, wall: Wall | None) -> PreparedChain:
    """A validated chain and its wall, prepared for marches.

    Raises NoEquilibrium, and InvalidChain where a contact would yield at rest: the static state is
    found by the elastic law.
    """
    static = static_state(chain, wall)

    # the static state is elastic
    if chain.yield_overlap is not None:
        overlap = chain.elastic.overlap(static.force)
        i = int((overlap / chain.yield_overlap).argmax())
        if overlap[i] > chain.yield_overlap[i]:
            raise InvalidChain(
                f"contact {i + 1} is pressed {overlap[i]:.3g} m at rest, beyond its yield overlap "
                f"of {chain.yield_overlap[i]:.3g} m; lower the preload or the leaf anchors"
            )

    # the load f_i - f_{i-1} balances the contact forces at rest; spheres in flight are not carried,
    # their load is their weight
    force = np.concatenate([[0.0], static.force, [0.0] if wall is None else []])
    load = force[1:] - force[:-1]
    load[: chain.n_falling] = chain.steady[: chain.n_falling]

    # dampers, with the inverse mass 1/m_i + 1/m_{i+1} of both bodies; phi phi is the wall's
    damping = None
    if chain.dissipation != "none" and np.any(chain.gamma):
        inverse = 1.0 / chain.mass
        pair = inverse[:-1] + inverse[1:]
        if wall is not None:
            pair = np.append(pair, inverse[-1] + wall.phi @ wall.phi)
        damping = Damping(
            np.asarray(chain.gamma, float), DAMPING_LAWS[chain.dissipation].number, pair
        )
    return PreparedChain(chain, wall, static, load if load.any() else None, damping)
