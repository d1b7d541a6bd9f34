"""Checks that a scene has the parts that a command needs: each returns it or raises
InvalidScene."""

from beadwave.workflows.scene.rig import RigScene
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import InvalidScene


def with_chain(scene: Scene) -> Scene:
    """A scene with spheres."""
    return _with(scene, scene.chain, "[chain]; add one, or take rig-1dof")


def with_chains(scene: Scene) -> Scene:
    """A scene with a chain, or with several."""
    return _with(scene, scene.chain or scene.chains, "[chain]; add one, or take rig-1dof")


def with_chains_or_structure(scene: Scene) -> Scene:
    """A scene with a chain or with several, or with finite elements alone."""
    return with_chains(scene) if scene.crystal or not scene.has_structure else scene


def with_spheres(scene: Scene) -> Scene:
    """A scene with a chain, with several, or with a crystal."""
    lacking = "[chain] and no [crystal]; add one, or take rig-1dof"
    return _with(scene, scene.chain or scene.chains or scene.crystal, lacking)


def with_structure(scene: Scene) -> Scene:
    """A scene with finite elements in it."""
    lacking = "[assembly], [beam] or [plate]; add one, or take rig-rom"
    return _with(scene, scene.has_structure, lacking)


def with_assembly(scene: Scene) -> Scene:
    """A scene with an assembly."""
    return _with(scene, scene.assembly, "[assembly]; add one, or take rig-rom")


def with_rig(scene: Scene) -> RigScene:
    """A scene of the thesis' rig."""
    lacking = "[assembly] of the thesis' rig; take rig-rom"
    return _with(scene, isinstance(scene, RigScene), lacking)


def with_targets(scene: Scene) -> Scene:
    """A scene that lists measured modes."""
    lacking = "targets; list measured modes in [[targets]], or give --match 1=738.6,2=2210.8"
    return _with(scene, scene.measured_hz, f"{lacking} or --hammer FILE")


def with_mac(scene: Scene) -> Scene:
    """A scene whose modes have a MAC matrix."""
    return _with(scene, scene.measured_hz, "targets for a MAC matrix; add [[targets]]")


def with_wall(scene: Scene) -> Scene:
    """A scene whose chain hits something."""
    return _with(scene, scene.wall, "[wall]; add one, or take rig-rigid")


def _with(scene: Scene, part: object, lacking: str) -> Scene:
    if not part:
        raise InvalidScene(f"the scene {scene.name} has no {lacking}.")
    return scene
