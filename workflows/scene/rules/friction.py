"""Keys of weight, guides, friction and arm that are each allowed but not together, a sentence
each."""

from collections.abc import Iterator

import numpy as np

from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.friction import arm_stiffness
from beadwave.workflows.scene.tables.walls import (
    HalfSpaceWall,
    OneDofWall,
    RigidWall,
    RomWall,
    gives_way,
)


def of_gravity(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between weight, guides and the rest of a scene."""
    gravity, guides = scene.gravity, scene.guides
    along = gravity.along if gravity else 0.0
    if along and scene.wall is None and not scene.leaf_springs:
        yield "[gravity] needs a [wall] or [leaf_springs] that carries the chain; add one."
    if along and gives_way(scene.wall) and not scene.leaf_springs:
        yield (
            f'[gravity] with wall.kind = "{scene.wall.kind}", which gives way to any steady force, '
            'as an infinite plate that nothing holds. Take wall.kind = "half-space" for a slab '
            'thicker than its waves are long, a [plate] with wall.kind = "rom", whose edges carry '
            "the chain, or gravity.inclination = 0, without what the weight adds to the speed of "
            "the waves."
        )
    if along < 0 and not scene.leaf_springs:
        yield (
            f"gravity.inclination = {gravity.inclination:g} lets the chain fall off the wall; hold "
            "it by [leaf_springs], or take an angle above 0."
        )
    of_assembly = isinstance(scene.wall, RomWall) and not scene.wall.file
    if along > 0 and of_assembly and scene.floats:
        yield "[gravity] presses on an assembly without supports; hold it, or drop [gravity]."
    if guides and scene.leaf_springs and np.any(scene.leaf_springs.stiffness):
        yield "[guides] and [leaf_springs] exclude each other: keep one of them."
    if guides and guides.coefficient and not (gravity and gravity.across):
        yield (
            f"guides.coefficient = {guides.coefficient:g} presses nothing on the guides: give "
            "guides.force, or [gravity] with an inclination between -90 and 90."
        )


def _of_structure(scene: Scene, wall: RomWall) -> Iterator[str]:
    """Sentences on what a structure that is met with friction does not take."""
    if scene.bending is not None and wall.file is None:
        table = "beam" if scene.beam else "plate"
        yield (
            f"[friction] needs a solid structure, [{table}] knows motions along the chain alone; "
            "take [assembly], or drop [friction]."
        )
    strike = scene.strike
    if wall.file is None and strike is not None and strike.weights == "thesis":
        yield (
            '[friction] needs a contact that is read where it is loaded; take weights "hertz", or '
            "drop [friction]."
        )
    if wall.file is None and scene.has_dashpots:
        yield (
            "[friction] takes a structure by its modes, which dashpots and [[measured]] couple; "
            "drop these, or drop [friction]."
        )


def of_friction(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between friction, arm and the rest of a scene."""
    friction, arm, wall = scene.friction, scene.arm, scene.wall
    velocity = scene.striker.tangential_velocity if scene.striker else None
    if friction is None:
        if arm is not None:
            yield "[arm] holds the last sphere against friction; add [friction], or drop [arm]."
        if velocity is not None:
            yield (
                f"striker.tangential_velocity = {list(velocity)} needs friction that acts on it; "
                "add [friction], or drop it."
            )
        return

    if friction.upstream == "held" and not (scene.shakers and isinstance(wall, RomWall)):
        yield (
            'friction.upstream = "held" holds the other spheres while shakers move a structure; '
            'add [[shakers]] with wall.kind = "rom", or drop it.'
        )

    if wall is None:
        yield "[friction] acts at the wall; add [wall], or drop [friction]."
        return
    yield from _of_walls(scene)
    yield from _of_contacts(scene)
    yield from _of_supports_across(scene)


def _of_walls(scene: Scene) -> Iterator[str]:
    """Sentences on walls other than those whose motion along the chain has no part across it."""
    wall = scene.wall
    if not isinstance(wall, RigidWall | HalfSpaceWall | OneDofWall | RomWall):
        yield (
            f'[friction] with wall.kind = "{wall.kind}", allowed are "rigid", "half-space", '
            '"1dof" and "rom"; take one of these, or drop [friction].'
        )
    if isinstance(wall, RomWall):
        yield from _of_structure(scene, wall)
    if isinstance(wall, OneDofWall):
        for key in ("young", "poisson"):
            if key not in wall.model_fields_set:
                yield (
                    f'wall.{key} is missing; with [friction] a wall.kind = "1dof" states the '
                    f"modulus and the ratio of its surface, add wall.{key}."
                )


def _of_contacts(scene: Scene) -> Iterator[str]:
    """Sentences on contacts other than those of elastic spheres, whose pressure is Hertz'."""
    friction, contact = scene.friction, scene.contact
    if contact.shaped:
        yield (
            f'[friction] with contact.law = "{contact.law}", of which no tangential law is known; '
            'take contact.law = "hertz", or drop [friction].'
        )
    if contact.law == "thornton":
        yield (
            '[friction] with contact.law = "thornton": the tangential law of contacts that yield '
            'is not known; take contact.law = "hertz", or drop [friction].'
        )
    damper = contact.dissipation.startswith("linear") and np.any(contact.coefficient)
    if damper:
        yield (
            f'[friction] with contact.dissipation = "{contact.dissipation}", whose force does not '
            'vanish with the contact\'s area; take "hunt-crossley", or drop [friction].'
        )
    factors = np.atleast_1d(contact.stiffness_factor)
    last = factors[-1]
    rubbing = friction.between_spheres is not None
    if rubbing and scene.chain.count == 1:
        yield (
            f"friction.between_spheres = {friction.between_spheres:g} with chain.count = 1, which "
            "has no contact between spheres; drop it, or add spheres."
        )
    elif rubbing and factors[max(-2, -factors.size)] != 1.0:
        yield (
            "contact.stiffness_factor of the contact before the last sphere must be 1 with "
            f"friction.between_spheres, found {factors[max(-2, -factors.size)]:g}: a factor says "
            "nothing of the contact's size; change it, or drop between_spheres."
        )
    if last != 1.0:
        yield (
            f"contact.stiffness_factor = {last:g} at the wall, with [friction] it must be 1 there: "
            "a factor says nothing of the contact's size; change it, or drop [friction]."
        )


def _of_supports_across(scene: Scene) -> Iterator[str]:
    """Sentences on what holds the last sphere across the chain, and moves it there."""
    arm, gravity = scene.arm, scene.gravity
    velocity = scene.striker.tangential_velocity if scene.striker else None
    if gravity and gravity.across and arm is None:
        yield (
            f"gravity.inclination = {gravity.inclination:g} weighs across the chain, which nothing "
            "carries at the last sphere; add [arm], or take an inclination of 90."
        )
    if scene.guides:
        yield (
            "[guides] hold the last sphere across the chain, [friction] moves it there; drop one "
            "of them."
        )
    if arm is not None and np.size(arm.stiffness) not in (1, 2):
        yield (
            f"arm.stiffness has {np.size(arm.stiffness)} values, allowed are one, or two along t1 "
            "and t2; change it."
        )
    if velocity is not None and scene.chain.count > 1:
        yield (
            f"striker.tangential_velocity is that of a chain of one sphere, found chain.count = "
            f"{scene.chain.count}: the others are guided along the chain; set chain.count to 1, "
            "or drop it."
        )
    elif velocity is not None and any(np.isinf(arm_stiffness(arm)) & (np.array(velocity) != 0)):
        yield (
            f"striker.tangential_velocity = {list(velocity)} with arm.stiffness = inf, which "
            "clamps the sphere; give a finite stiffness, or drop it."
        )
