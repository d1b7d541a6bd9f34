"""A reduced model made elsewhere as the wall: wall.file read, and what forbids it.

Refused is what cannot be run; what can, but was probably meant otherwise, is for wall_doubts.
"""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

import rom
from workflows.scene import InvalidScene, RomWall

HALF_SPACE = "half_space_compliance_m_per_N"
READERS = {".npz": rom.load_npz, ".mat": rom.load_mat, ".h5": rom.load_h5, ".mtx": rom.load_mtx}
NUMBERS = (  # notes that are read back
    HALF_SPACE, "hammer_modes_hz", "reading_weights", "effective_mass_captured", "mass_kg",
    "centre_m", "grounding",
)  # fmt: skip
FEW_DIGITS = -1e-5  # of the largest eigenvalue: what rounding makes of a wall that floats


def loaded(wall: RomWall) -> rom.ReducedModel:
    """The reduced model of wall.file; raises InvalidScene where it is none, or no wall."""
    path = Path(wall.file)
    if path.suffix not in READERS:
        raise InvalidScene(f"wall.file = {wall.file!r} must end in {', '.join(READERS)}.")
    require_reader(path)
    if path.suffix != ".mtx" and wall.nodes:
        raise InvalidScene("wall.nodes names nodes of an Abaqus .mtx; drop it.")
    try:
        reduced = _substructure(path, wall) if path.suffix == ".mtx" else READERS[path.suffix](path)
    except rom.ReductionError as error:
        raise InvalidScene(f"wall.file: {error}") from None
    for finding in (*_unsound(reduced), *_unreadable_notes(reduced)):
        raise InvalidScene(f"wall.file: {path} is no wall that could be run: {finding}")
    if wall.half_space is None:
        return reduced
    return reduced._replace(provenance=reduced.provenance | {HALF_SPACE: repr(wall.half_space)})


def _unsound(reduced: rom.ReducedModel):
    health = rom.health(reduced)
    hint = " A wall that floats, written with few digits, looks so: write K with 16."
    rounding = FEW_DIGITS < health.lowest_stiffness < 0
    yield from (finding + hint * bool(rounding) for finding in health.findings)


def _unreadable_notes(reduced: rom.ReducedModel):
    """Notes of ours that a stranger's file fills with something else."""
    for name in NUMBERS:
        text = str(reduced.provenance.get(name, "0"))
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = [np.nan]
        if not values or not np.isfinite(values).all():
            yield f"its note {name} is {text!r}; it must hold numbers, leave it out."
        if name == HALF_SPACE and values[0] < 0:
            yield f"its note {name} is {text!r}; a compliance is >= 0."
        if name == "reading_weights" and len(values) > len(reduced.w):
            yield f"reading_weights has {len(values)} values for {len(reduced.w)} coordinates."


def _substructure(path: Path, wall: RomWall) -> rom.ReducedModel:
    known = rom.substructure(path).coordinates
    if not wall.nodes:
        some = ", ".join(map(str, sorted({node for node, _ in known})[:6]))
        raise InvalidScene(
            f"wall.nodes is missing: {path} is an Abaqus substructure and does not say where the "
            f"chain touches it; name those nodes of {some} ..., with wall.direction and weights."
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
        raise InvalidScene(f"{path} needs h5py; ./install.sh h5 adds it, or take .npz or .mat.")
