from fem.contact_patch import (
    ContactPatch,
    contact_patch,
    disc_quadrature,
    node_patch,
)
from fem.correlation import Pairing, body_shapes, mac, pair
from fem.dashpots import dashpots
from fem.elasticity import Material, Structure, assemble
from fem.factorisation import factorised
from fem.grounding import RigidBody, rigid_body
from fem.half_space import half_space_on_mesh
from fem.joints import DIRECTIONS, Joint
from fem.mirror import mirrored
from fem.model import Model, Table, full_tie, screw_tie, wires
from fem.modes import Modes, modes
from fem.response import receptance
from fem.trace import outer_nodes

__all__ = [
    "DIRECTIONS",
    "ContactPatch",
    "Joint",
    "Material",
    "Model",
    "Modes",
    "Pairing",
    "RigidBody",
    "Structure",
    "Table",
    "assemble",
    "body_shapes",
    "contact_patch",
    "dashpots",
    "disc_quadrature",
    "factorised",
    "full_tie",
    "half_space_on_mesh",
    "mac",
    "mirrored",
    "modes",
    "node_patch",
    "outer_nodes",
    "pair",
    "receptance",
    "rigid_body",
    "screw_tie",
    "wires",
]
