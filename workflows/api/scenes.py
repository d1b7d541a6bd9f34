"""Scenes by name, by file, as tables."""

from workflows.files.scene import Changes, Source, built_in
from workflows.files.scene import scene as _loaded
from workflows.scene import Scene


def scene(source: Source = None, changes: Changes = ()) -> Scene:
    """A scene, checked, with every default filled in.

    `source` is the name of a built-in scene (`scenes()` lists them), a TOML file, a dict of
    tables, or a Scene; None is the rig with its reduced model, rig-rom. `changes` sets values
    by their dotted keys, {"chain.radius": 0.005} or "chain.radius=5mm". All functions that take
    a scene take these two. Raises InvalidScene with the key, the value found and the one allowed.

    >>> scene("rig-rigid", {"striker.velocity": 0.5}).striker.velocity
    0.5
    """
    return _loaded(source, changes)


def scenes() -> dict[str, str]:
    """The built-in scenes, name to what each shows, the default first."""
    return {name: text.splitlines()[0].removeprefix("# ") for name, text in built_in().items()}
