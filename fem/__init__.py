"""Finite elements of an assembly: K and M, ties and joints, contact, modes. SI units.

    assemble        meshes and materials by body -> Structure with K [N/m], M [kg]
    joined          Structure and Connections (ties, joints, held faces) -> Model with K, M
    contact_patch   w (n,) of a disc on a face: u_w = w @ u [m] is read, w F [N] is the load
    half_space_on_mesh   compliance [m/N] of the patch on a half-space, which Hertz' law holds too
    half_space_matrix    the same along the normal and in the face (3, 3), for friction
    joint_stiffness_by_formula   springs of a bolt from its drawing, with their spreads
    prestressed     the Model under forces, heat and rods: K + K_G, and its share of buckling
    modes           omega (k,) [rad/s], phi (n, k) mass-normalised, by eigsh
    receptance      H(f) [m/N] of the full model;   mac, pair: modes compared with measured ones
    held            factor of a K that is held, which modes and a reduction can share
    factorised      factor of a sparse symmetric matrix, the fastest that is installed

u are the free displacements of a Model, u_mesh = model.T @ u, node after node x, y, z.

    structure = fem.assemble({"beam": mesh}, {"beam": fem.Material(210e9, 0.3, 7850.0)})
    model = fem.joined(structure, fem.Connections(held=[fem.HeldFace("beam:back")]))
    hz = fem.modes(model.K, model.M, 10).frequency_hz

    beam, mindlin_plate   bending by the theories of Timoshenko and of Mindlin, as K, M and w

See examples/own_mesh.py, from a mesh of one's own to an impact.
"""

from beadwave.fem.assembly.attached_mass import CarriedMass, with_carried, with_mass_on_face
from beadwave.fem.assembly.dashpots import dashpots
from beadwave.fem.assembly.elasticity import Structure, assemble
from beadwave.fem.assembly.grounding import RigidBody, rigid_body
from beadwave.fem.assembly.joints import DIRECTIONS, Bushing, Joint, Side, Tie, normal_frame
from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.measured_part import (
    MeasuredPart,
    PartPoint,
    joint_stiffness,
    with_measured,
)
from beadwave.fem.assembly.mechanisms import Loose, loose_bodies
from beadwave.fem.assembly.mirror import mirrored
from beadwave.fem.assembly.model import Connections, HeldFace, Model, SwayingTable, joined
from beadwave.fem.assembly.prestress import FaceForce, Heat, Load, prestressed
from beadwave.fem.assembly.rods import Rod
from beadwave.fem.assembly.springs import PointSpring, SpringEnd, missed_in_dents, with_springs
from beadwave.fem.assembly.surface import OnSurface, on_surface
from beadwave.fem.assembly.trace import face_edges, outer_nodes
from beadwave.fem.bending.beam import (
    ENDS,
    BeamCorrection,
    BeamEnd,
    Section,
    beam,
    rectangle,
    section,
    tube,
)
from beadwave.fem.bending.bending_model import Bending, Buckled
from beadwave.fem.bending.plate import PlateCorrection, Sheet, TooLarge, mindlin_plate
from beadwave.fem.contact.anisotropic_half_space import indentation_modulus
from beadwave.fem.contact.bolted_joint import (
    Bolt,
    Fastener,
    JointStiffness,
    Member,
    PressedFaces,
    fastener_masses,
    joint_stiffness_by_formula,
)
from beadwave.fem.contact.contact_patch import (
    ContactPatch,
    contact_patch,
    disc_quadrature,
    node_patch,
)
from beadwave.fem.contact.half_space import (
    HalfSpaceField,
    half_space_fields,
    half_space_matrix,
    half_space_on_mesh,
    half_spaces_on_mesh,
)
from beadwave.fem.contact.impact_point import SurfacePoint, planar_spot, round_spot
from beadwave.fem.errors.left_out import LeftOut, energy_left_out
from beadwave.fem.errors.stress_error import Faces, MissedEnergy, Pushed, missed_energy
from beadwave.fem.modes.mac import (
    BodyMotion,
    Number,
    Pairing,
    Shape,
    Target,
    effective_mass,
    mac,
    pair,
    target_mac,
)
from beadwave.fem.modes.modes import Modes, held, modes
from beadwave.fem.modes.solver.factorisation import Factor, factorised
from beadwave.fem.modes.solver.receptance import receptance
from beadwave.fem.modes.solver.threads import one_thread

__all__ = [
    "DIRECTIONS",
    "ENDS",
    "BeamCorrection",
    "BeamEnd",
    "Bending",
    "BodyMotion",
    "Bolt",
    "Buckled",
    "Bushing",
    "CarriedMass",
    "Connections",
    "ContactPatch",
    "FaceForce",
    "Faces",
    "Factor",
    "Fastener",
    "HalfSpaceField",
    "Heat",
    "HeldFace",
    "Joint",
    "JointStiffness",
    "LeftOut",
    "Load",
    "Loose",
    "Material",
    "MeasuredPart",
    "Member",
    "MissedEnergy",
    "Model",
    "Modes",
    "Number",
    "OnSurface",
    "Orthotropic",
    "Pairing",
    "PartPoint",
    "PlateCorrection",
    "PointSpring",
    "PressedFaces",
    "Pushed",
    "RigidBody",
    "Rod",
    "Section",
    "Shape",
    "Sheet",
    "Side",
    "SpringEnd",
    "Structure",
    "SurfacePoint",
    "SwayingTable",
    "Target",
    "Tie",
    "TooLarge",
    "assemble",
    "beam",
    "contact_patch",
    "dashpots",
    "disc_quadrature",
    "effective_mass",
    "energy_left_out",
    "face_edges",
    "factorised",
    "fastener_masses",
    "half_space_fields",
    "half_space_matrix",
    "half_space_on_mesh",
    "half_spaces_on_mesh",
    "held",
    "indentation_modulus",
    "joined",
    "joint_stiffness",
    "joint_stiffness_by_formula",
    "loose_bodies",
    "mac",
    "mindlin_plate",
    "mirrored",
    "missed_energy",
    "missed_in_dents",
    "modes",
    "node_patch",
    "normal_frame",
    "on_surface",
    "one_thread",
    "outer_nodes",
    "pair",
    "planar_spot",
    "prestressed",
    "receptance",
    "rectangle",
    "rigid_body",
    "round_spot",
    "section",
    "target_mac",
    "tube",
    "with_carried",
    "with_mass_on_face",
    "with_measured",
    "with_springs",
]
