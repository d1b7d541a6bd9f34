"""[friction] and [arm]: Coulomb friction of the last sphere at the wall, and what holds it across.

Axes across the chain: t1, t2 lie in the wall, t2 = n x t1 with n into the wall; before a wall of a
few numbers the chain lies along x, t1 is y and t2 is z.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from workflows.scene.quantities import of
from workflows.scene.scene_table import (
    NonNegative,
    SceneTable,
    Spring,
    TurnSpring,
    one_or_each,
)
from workflows.scene.units import INERTIA
from workflows.scene.walls import HalfSpaceWall, OneDofWall, RigidWall, RomWall

if TYPE_CHECKING:
    from workflows.scene.scene import Scene


class Friction(SceneTable):
    """Friction of the last sphere at the wall, exact under any history (Cattaneo and Mindlin)."""

    coefficient: Annotated[NonNegative, Field(le=10)]  # tangential over normal force where it slips
    # the other spheres while shakers move a structure, before the striker comes: they move with it,
    # or are held at rest
    upstream: Literal["free", "held"] = "free"
    # the same between spheres: of the last one on the one before, which stays on the chain's line
    between_spheres: Annotated[NonNegative, Field(le=10)] | None = None


class Arm(SceneTable):
    """Holds the last sphere across the chain: springs at rest in the static state; inf clamps."""

    stiffness: one_or_each(Spring) = 0.0  # [N/m] across the chain, or along [t1, t2]
    rotation: TurnSpring = 0.0  # [N m/rad] against turns about t1 and t2
    inertia: of(NonNegative, INERTIA, 0, 10) = 0.0  # [kg m^2] besides the sphere's own


def arm_stiffness(arm: Arm | None) -> np.ndarray:
    """(2,) [N/m] along t1 and t2; 0 without an arm."""
    return np.array(np.broadcast_to(0.0 if arm is None else arm.stiffness, 2), float)


def _of_structure(scene: "Scene", wall: RomWall) -> Iterator[str]:
    """Sentences on what a structure that is met with friction does not take."""
    if scene.bending is not None and wall.file is None:
        table = "beam" if scene.beam else "plate"
        yield (
            f"[friction] needs a solid structure, [{table}] knows motions along the chain alone; "
            "take [assembly], or drop [friction]."
        )
    if scene.friction.between_spheres is not None:
        yield (
            "friction.between_spheres is known before walls of a few numbers alone; drop it before "
            "a structure."
        )
    if wall.prune:
        yield "wall.prune counts what modes do along the chain alone; drop it with [friction]."
    strike = scene.written_out.strike
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


def of_friction(scene: "Scene") -> Iterator[str]:
    """Sentences on contradictions between friction, arm and the rest of a scene."""
    friction, arm, wall, contact = scene.friction, scene.arm, scene.wall, scene.contact
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

    # walls: those whose motion along the chain has no part across it
    if wall is None:
        yield "[friction] acts at the wall; add [wall], or drop [friction]."
        return
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

    # contacts: elastic spheres, whose pressure is Hertz'
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

    # what holds the sphere across the chain
    gravity = scene.gravity
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
