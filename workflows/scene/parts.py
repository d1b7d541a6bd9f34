"""Parts of a scene that a command or a study cannot do without."""

from workflows.scene.scene import Scene
from workflows.scene.tables import InvalidScene


def with_chain(scene: Scene) -> Scene:
    """The scene; raises InvalidScene where it has no spheres."""
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-1dof.")
    return scene


def with_structure(scene: Scene) -> Scene:
    """The scene; raises InvalidScene where there are no finite elements in it."""
    if not scene.has_structure:
        raise InvalidScene(
            f"the scene {scene.name} has no [assembly], [beam] or [plate]; add one, or take "
            "rig-rom."
        )
    return scene


def with_assembly(scene: Scene) -> Scene:
    """The scene; raises InvalidScene where it has no assembly."""
    if scene.assembly is None:
        raise InvalidScene(f"the scene {scene.name} has no [assembly]; add one, or take rig-rom.")
    return scene


def with_targets(scene: Scene) -> Scene:
    """The scene; raises InvalidScene where it lists no measured modes."""
    if not scene.measured_hz:
        raise InvalidScene(
            f"the scene {scene.name} has no targets; list measured modes in [[targets]]."
        )
    return scene


def with_wall(scene: Scene) -> Scene:
    """The scene; raises InvalidScene where the chain hits nothing."""
    if scene.wall is None:
        raise InvalidScene(f"the scene {scene.name} has no [wall]; add one, or take rig-rigid.")
    return scene
