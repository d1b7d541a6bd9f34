"""striker.drop: the velocity of a striker that falls onto the chain."""

from math import pi, sqrt

import numpy as np

from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import InvalidScene
from beadwave.workflows.scene.tables.chain import Striker
from beadwave.workflows.scene.tables.gravity import friction

SAME = 1e-9  # relative difference of a stated velocity to that of the stated drop


def fallen(scene: Scene, source: str) -> Striker | None:
    """The striker with the velocity that its drop gives it; raises InvalidScene where it gives
    none, or where both are given and differ."""
    if scene.striker is None or scene.striker.drop is None:
        return scene.striker
    drop, stated = scene.striker.drop, scene.striker.velocity
    R, rho = (float(np.atleast_1d(x)[0]) for x in (scene.chain.radius, scene.chain.density))
    mass = 4 / 3 * pi * R**3 * rho

    # v = sqrt(2 a h) with the weight along the chain less the friction of the guides
    force = np.atleast_1d(friction(scene.guides, scene.gravity, mass))[0]
    net = (scene.gravity.along if scene.gravity else 0.0) - force / mass
    if net <= 0:
        raise InvalidScene(
            f"{source}: striker.drop = {drop:g} m makes no fall, {net:.3g} m/s^2 act on the "
            "striker towards the wall; add [gravity], incline the chain, or give striker.velocity."
        )
    speed = sqrt(2 * net * drop)
    if stated is not None and abs(stated / speed - 1) > SAME:
        raise InvalidScene(
            f"{source}: striker.velocity = {stated:g} m/s, but striker.drop = {drop:g} m gives "
            f"{speed:.6g} m/s; drop one of them."
        )
    return scene.striker.but(velocity=speed)
