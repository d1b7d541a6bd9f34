"""Limits and spreads of the frequencies of an assembly whose bolts are known from their drawing."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from beadwave import fem
from beadwave.fem.assembly.constraints import congruent
from beadwave.fem.contact.joint_bounds import JointBounds, spread_hz
from beadwave.fem.contact.preloaded_contact import (
    MINDLIN,
    OPEN,
    joined_stiffness,
    rim,
)
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.modes import Unstable
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.meshed_parts import Parts

MOST_OPENED = 0.5  # of the zone's area
NORMAL = np.array([False, False, True, True, True, False])  # of fem.DIRECTIONS


def joint_bounds(scene: Scene, mesh: Parts, model: fem.Model, modes: AssemblyModes) -> JointBounds:
    """Frequencies with the faces under bolts tied all over and without friction, and deviations."""
    computed = fem.Modes(modes.omega, modes.phi)
    n, n_dofs = len(modes.omega), model.structure.n_dofs
    below = scene.table and fem.SwayingTable(scene.table.frequency, scene.table.mass)
    by_number = {place.number: place for place in mesh.bolted if not place.in_contact}

    def modes_of(connections: fem.Connections, stuck: csr_matrix | None = None) -> fem.Modes:
        """The modes of the bodies with other connections, and with springs (ndof, ndof) [N/m]."""
        other = fem.joined(model.structure, connections._replace(table=below))
        if stuck is not None:
            other = other._replace(K0=(other.K0 + congruent(other.T, stuck)).tocsc())
        if mesh.load is not None:
            other = fem.prestressed(other, mesh.materials, mesh.load)
        return fem.modes(other.K, other.M, n)

    def modes_in(**other: NDArray) -> fem.Modes:
        """The modes with other states or frictions of the facets in contact."""
        contact = model.contact
        changed = joined_stiffness(contact._replace(**other)) - joined_stiffness(contact)
        other = model._replace(K0=(model.K0 + changed).tocsc())
        return fem.modes(other.K, other.M, n)

    def change_by_rim(at_rim: NDArray[np.int64]) -> NDArray[np.float64]:
        """[Hz] by which modes fall as facets at the rim open, the least pressed first: all of them,
        or as many as leave a zone that carries the load, and in proportion."""
        contact, area = model.contact, model.contact.facets.area
        for share in (MOST_OPENED, MOST_OPENED / 4):
            opens = at_rim[np.cumsum(area[at_rim]) <= share * contact.zone_area]
            state = contact.state.copy()
            state[opens] = OPEN
            try:
                change = computed.frequency_hz - modes_in(state=state).frequency_hz
            except Unstable:  # a ball rolls off on a smaller zone
                continue
            whole = min(area[at_rim].sum(), MOST_OPENED * contact.zone_area)
            return change * whole / max(area[opens].sum(), area.min())
        return computed.frequency_hz

    # without friction: shear is that of the bolts after slip
    joint, direction = np.divmod(model.free[model.elongation] - n_dofs, 6)
    slipped, deviation = model.stiffness.copy(), np.zeros(len(joint))
    names = np.array([name.rpartition(".")[0] for name in model.spring], dtype=object)
    for spring, (i, d) in enumerate(zip(joint, direction, strict=True)):
        if (place := by_number.get(int(i))) and place.deviation[d]:
            slipped[spring] = min(place.stiffness.slipped[d], slipped[spring])
            deviation[spring] = place.deviation[d]
    sliding = model._replace(stiffness=slipped)
    if model.contact is None:
        without_friction = fem.modes(sliding.K, sliding.M, n)
    else:
        try:
            without_friction = modes_in(friction=np.zeros(len(model.contact.friction)))
        except Unstable:  # friction alone keeps the bodies where they are
            without_friction = fem.Modes(0 * computed.omega, computed.phi)

    # groups of springs whose errors have one cause: those across and those along the faces of the
    # joints of a table
    groups = [
        deviation * ((names == name) & (NORMAL[direction] == across))
        for name in dict.fromkeys(place.joint for place in by_number.values())
        for across in (True, False)
    ]
    spread = spread_hz(model, computed, without_friction, groups)

    # faces in contact: half of what the frequency changes as facets at the rim of the zone open is
    # one deviation; of a zone one facet wide the less pressed half opens, all of it would part
    hz = computed.frequency_hz
    if model.contact is not None:
        at_rim = np.flatnonzero(rim(model.contact))
        at_rim = at_rim[np.argsort(model.contact.pressure[at_rim])]
        spread = np.hypot(spread, change_by_rim(at_rim) / 2)

    # discs are neither rigid nor as flexible as the face alone: half of what a model differs in
    # which both are held by their mean is one deviation
    if by_number:
        joints = list(mesh.connections.joints)
        for i in by_number:
            sides = (side._replace(coupling="mean") for side in (joints[i].first, joints[i].second))
            joints[i] = joints[i]._replace(**dict(zip(("first", "second"), sides, strict=True)))
        by_mean = modes_of(mesh.connections._replace(joints=joints))
        spread = np.hypot(spread, (hz - by_mean.frequency_hz) / 2)

    # tied: ties over all that the bolts press in place of their joints; of faces that touch at a
    # point or along a line the zone sticks
    connections = mesh.connections
    bolted = {place.number for place in mesh.bolted}
    joints = [j for i, j in enumerate(connections.joints) if i not in bolted]
    rounds = {faces.pair for faces in mesh.in_contact if faces.is_round}
    over_area = [tie for tie in mesh.closed if tie.slave.partition(":")[2] not in rounds]
    tied, stuck = connections._replace(joints=joints, ties=[*connections.ties, *over_area]), None
    if rounds:
        facets, at_round = model.contact.facets, [f.is_round for f in mesh.in_contact]
        on = np.array(at_round)[facets.pair] & (model.contact.state != OPEN)
        k = on * facets.area * model.contact.hard
        layers = np.concatenate([k, MINDLIN * k, MINDLIN * k])
        stuck = csr_matrix(facets.C.T @ diags_array(layers) @ facets.C)
    tied_hz = modes_of(tied, stuck).frequency_hz
    # the geometric stiffness of the pressure of round faces is left out of it
    tied_hz = np.maximum(tied_hz, hz) if rounds else tied_hz
    return JointBounds(tied_hz, without_friction.frequency_hz, spread)
