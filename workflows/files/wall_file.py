"""A reduced model made elsewhere as the wall: wall.file read, and what forbids it.

Models that cannot be run are refused here; for doubtful ones there are warnings (`rom.imported`).
"""

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from beadwave import rom
from beadwave.rom.imported import sound
from beadwave.system import adding
from beadwave.workflows.files.foreign import Refused, Unreadable, through_child
from beadwave.workflows.scene import InvalidScene, RomWall

ENDINGS = (".npz", ".mat", ".h5", ".mtx")


class WallFile(NamedTuple):
    """A reduced model made elsewhere and its health, the modes among it."""

    reduced: rom.ReducedModel
    health: rom.Health


def loaded(wall: RomWall) -> rom.ReducedModel:
    """The reduced model of wall.file; raises InvalidScene where it is none, or no wall."""
    return measured(wall).reduced


def measured(wall: RomWall) -> WallFile:
    """The reduced model of wall.file and its health, read again only where the file has changed;
    raises InvalidScene where it is none, or no wall."""
    path = Path(wall.file)
    if path.suffix not in ENDINGS:
        raise InvalidScene(f"wall.file = {wall.file!r} must end in {', '.join(ENDINGS)}.")
    require_reader(path)
    if path.suffix != ".mtx" and wall.nodes:
        raise InvalidScene("wall.nodes names nodes of an Abaqus .mtx; drop it.")
    status = path.stat()
    return _measured(path, wall, (status.st_mtime_ns, status.st_size, status.st_ino))


@lru_cache(maxsize=1)
def _measured(path: Path, wall: RomWall, stamp: tuple[int, int, int]) -> WallFile:
    """`measured` of a file with this stamp."""
    # text and archives of numpy are parsed here, all else in a child
    try:
        if path.suffix == ".mtx":
            reduced = of_substructure(path, wall)
        elif path.suffix == ".npz":
            reduced = rom.load_npz(path)
        else:
            reduced = through_child("reduced", path, rom.load_npz)
    except (rom.ReductionError, Refused) as error:
        raise InvalidScene(f"wall.file: {str(error).rstrip('.')}.") from None
    except Unreadable as error:
        raise InvalidScene(f"wall.file: {path}: {error}; write it anew.") from None
    try:
        health = sound(reduced)
    except rom.ReductionError as error:
        raise InvalidScene(f"wall.file: {path} {error}") from None
    if wall.half_space is not None:
        contact = reduced.contact._replace(half_space=wall.half_space)
        columns = reduced.columns and reduced.columns._replace(half_space=None)
        reduced = reduced._replace(contact=contact, columns=columns)
    return WallFile(reduced, health)


def with_surface(wall: RomWall) -> RomWall:
    """The wall with the material struck that its file states; raises InvalidScene for another."""
    contact = loaded(wall).contact
    made_of = {key: getattr(contact, key) for key in ("young", "poisson", "curvatures")}
    stated = {key: value for key, value in made_of.items() if value is not None}
    for key, value in stated.items():
        in_scene = getattr(wall, key)
        if in_scene is not None and in_scene != value:
            raise InvalidScene(
                f"wall.{key} = {_shown(in_scene)}, but wall.file was made of a surface with "
                f"{_shown(value)}; drop wall.{key}, or take another file."
            )
    return wall.model_copy(update=stated)


def _shown(value: float | tuple[float, ...]) -> str:
    return str(list(value)) if isinstance(value, tuple) else f"{value:g}"


def of_substructure(path: Path, wall: RomWall) -> rom.ReducedModel:
    """The model of an Abaqus substructure, loaded and read at wall.nodes with wall.weights of sum
    1; raises InvalidScene where these keys do not fit the file, ReductionError for the file."""
    # the nodes that the chain touches, each once, and weights that can be scaled to the sum 1
    coordinates = rom.substructure(path).coordinates
    if not wall.nodes:
        first = ", ".join(map(str, sorted({node for node, _ in coordinates})[:6]))
        raise InvalidScene(
            f"wall.nodes is missing: {path} is an Abaqus substructure and does not say where the "
            f"chain touches it; name those nodes of {first} ..., with wall.direction and weights."
        )
    weights = wall.weights or (1.0,) * len(wall.nodes)
    if len(weights) != len(wall.nodes):
        raise InvalidScene(
            f"wall.weights has {len(weights)} values for {len(wall.nodes)} nodes; give one each."
        )
    if not abs(sum(weights)) > 1e-9 * sum(map(abs, weights)):
        raise InvalidScene(
            f"wall.weights = {list(weights)} sum to zero and are no average; those of quadratic "
            "elements may be negative, their sum is not."
        )
    twice = [node for node in wall.nodes if wall.nodes.count(node) > 1]
    if twice:
        raise InvalidScene(f"wall.nodes names node {twice[0]} twice; give its weight once.")
    w = {
        (node, wall.direction): weight / sum(weights)
        for node, weight in zip(wall.nodes, weights, strict=True)
    }
    return rom.load_mtx(path, w)


def require_reader(path: Path) -> None:
    """Raises InvalidScene for HDF5 where the extra that reads and writes it is not installed."""
    if path.suffix == ".h5" and find_spec("h5py") is None:
        raise InvalidScene(f"{path} needs h5py; {adding('h5')} adds it, or take .npz or .mat.")
