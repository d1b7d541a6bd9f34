"""A reduced model made elsewhere as the wall: wall.file read, and what speaks against it.

Refused is what cannot be run; doubtful is what can, but was probably meant otherwise: weights that
are no average, stiffness and mass in other units than N/m and kg.
"""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

import rom
from workflows.scene import InvalidScene, RomWall

HALF_SPACE = "half_space_compliance_m_per_N"
READERS = {".npz": rom.load_npz, ".mat": rom.load_mat, ".h5": rom.load_h5, ".mtx": rom.load_mtx}
NUMBERS = (HALF_SPACE, "hammer_modes_hz", "reading_weights")  # notes that are read back
COMPLIANCE = (1e-12, 1e-4)  # [m/N] of anything that a steel sphere rebounds from
LOWEST_HZ = (0.1, 50e3)


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
    for finding in (*rom.health(reduced).findings, *_unreadable_notes(reduced)):
        raise InvalidScene(f"wall.file: {path} is no wall that could be run: {finding}")
    if wall.half_space is None:
        return reduced
    return reduced._replace(provenance=reduced.provenance | {HALF_SPACE: repr(wall.half_space)})


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
        if name == "reading_weights" and len(values) > len(reduced.w):
            yield f"reading_weights has {len(values)} values for {len(reduced.w)} coordinates."


def doubts(wall: RomWall) -> tuple[str, ...]:
    """What in the file of a wall was probably meant otherwise, a sentence each."""
    reduced = loaded(wall)
    return (*_no_average(reduced), *_other_units(reduced))


def _no_average(reduced: rom.ReducedModel):
    total = float(reduced.w.sum())
    modal = not np.any(reduced.K - np.diag(np.diag(reduced.K)))
    if reduced.kind != "imported" or modal or abs(total - 1) < 1e-6:
        return
    yield (
        f"The weights w of wall.file sum to {total:.6g}, not to 1: they read {total:.6g} m where "
        "all its points move by 1 m. That is right for coordinates other than displacements only."
    )


def _other_units(reduced: rom.ReducedModel):
    wall = rom.modal(reduced)
    compliance, elastic = rom.modal_compliance(wall), wall.omega[wall.omega > 0]
    lowest = elastic[0] / (2 * np.pi) if len(elastic) else None
    measures = (
        ("static compliance at the contact", compliance or None, COMPLIANCE, "m/N"),
        ("lowest elastic mode", lowest, LOWEST_HZ, "Hz"),
    )
    for name, value, (least, most), unit in measures:
        if value is not None and not least < value < most:
            yield (
                f"The {name} of wall.file is {value:.3g} {unit}, far from {least:g} to {most:g} "
                f"{unit} of solid walls; K is taken in N/m, M in kg, both in SI."
            )


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
