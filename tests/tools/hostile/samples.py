"""A small good file of each format that users give."""

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from scipy.io import savemat

from beadwave import rom
from beadwave.workflows.files import hammer
from beadwave.workflows.files.uff import pyuff

RESONANCE_HZ = 300.0
POINTS = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0.05, 0], [0.3, 0, 0.02]])
SHAPE = np.array([[0, 0, 0.1], [0, 0, 0.4], [0, 0.1, 0.7], [0, 0, 1.0]])
MASSES = 6


def written(write: Callable[[Path], object], ending: str) -> bytes:
    """Bytes that `write` leaves in a file of this ending."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"sample{ending}"
        write(path)
        return path.read_bytes()


def velocities() -> bytes:
    return _table("time [ms], sphere 1 [mm/s], sphere 4 [mm/s]", 1.0)


def signals() -> bytes:
    return _table("time [us], sphere 9 force [N], sphere 4 force-rate [mV]", 1e3)


def _table(header: str, scale: float) -> bytes:
    t = 1e-2 * np.arange(80)
    table = np.column_stack([scale * t, np.sin(t), np.cos(t)])
    lines = (",".join(f"{x:.6g}" for x in row) for row in table)
    return "\n".join(["# a title", header, *lines]).encode()


def velocities_mat() -> bytes:
    t = 1e-5 * np.arange(80)
    held = {"t": t, "v": np.column_stack([t, t]), "spheres": [1, 4]}
    return written(
        lambda path: savemat(path, held | {"time_unit": "s", "velocity_unit": "m/s"}), ".mat"
    )


def hammer_csv() -> bytes:
    return written(lambda path: hammer.write_csv(path, _hammer_test()), ".csv")


def hammer_uff() -> bytes:
    return written(lambda path: hammer.write_uff(path, _hammer_test()), ".uff")


def _hammer_test() -> hammer.Responses:
    f = np.linspace(10.0, 1000.0, 60)
    H = 1.0 / (RESONANCE_HZ**2 - f**2 + 0.1j * RESONANCE_HZ * f)
    return hammer.Responses(f, np.array([H]), "a test")


def shapes() -> tuple[bytes, ...]:
    """Of data sets 55, and of responses in data sets 58."""
    return tuple(
        written(lambda path, sets=sets: _write_uff(path, (_nodes(), *sets)), ".uff")
        for sets in ([_shape()], [*_responses()])
    )


def _write_uff(path: Path, sets: tuple[dict, ...]) -> None:
    file = pyuff().UFF(str(path))
    for i, one in enumerate(sets):
        file.write_sets(one, mode="add" if i else "overwrite")


def _nodes() -> dict:
    x, y, z = map(list, POINTS.T)
    zero = [0] * len(POINTS)
    return pyuff().prepare_15([1, 2, 3, 4], zero, zero, zero, x, y, z)


def _shape() -> dict:
    parts = {f"r{i + 1}": SHAPE[:, i] for i in range(3)}
    return pyuff().prepare_55(
        model_type=1, analysis_type=2, data_ch=2, spec_data_type=8, data_type=2, n_data_per_node=3,
        node_nums=np.arange(1, 5), load_case=1, mode_n=1, freq=RESONANCE_HZ, modal_m=0,
        modal_damp_vis=0.0, modal_damp_his=0.0, **parts,
        **{f"id{i}": "NONE" for i in range(1, 6)},
    )  # fmt: skip


def _responses() -> Iterator[dict]:
    test = _hammer_test()
    for node, reading in enumerate(SHAPE[:, 2], start=1):
        yield pyuff().prepare_58(
            binary=0, func_type=4, rsp_node=node, rsp_dir=3, ref_node=4, ref_dir=3,
            data=reading * test.H[0], x=test.frequency_hz, id1="test", rsp_ent_name="r",
            ref_ent_name="h", abscissa_spacing=1, abscissa_spec_data_type=18,
            ordinate_spec_data_type=12, orddenom_spec_data_type=13,
        )  # fmt: skip


def _chain_of_masses() -> tuple[np.ndarray, np.ndarray]:
    K = 1e8 * (2 * np.eye(MASSES) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1))
    return K, 0.4 * np.eye(MASSES)


def wall(save: Callable[[Path, rom.ReducedModel], object], ending: str) -> bytes:
    reduced = rom.full_order(*_chain_of_masses(), np.eye(MASSES)[-1])
    return written(lambda path: save(path, reduced), ending)


def substructure() -> bytes:
    """As Abaqus writes it: three degrees of freedom of the nodes 7 and 8."""
    lines = ["*USER ELEMENT, NODES= 2, LINEAR", "** ELEMENT NODES", "** 7, 8", " 1, 2, 3"]
    for kind, A in zip(("STIFFNESS", "MASS"), _chain_of_masses(), strict=True):
        rows = (", ".join(f"{x:.16E}" for x in row[: i + 1]) for i, row in enumerate(A))
        lines += [f"*MATRIX,TYPE={kind}", *rows]
    return "\n".join([*lines, ""]).encode()


def mesh() -> bytes:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
    tags = {name: [np.array([1, 1])] for name in ("gmsh:physical", "gmsh:geometrical")}
    cells, names = [("tetra", np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))], {"block": np.array([1, 3])}
    whole = meshio.Mesh(points, cells, cell_data=tags, field_data=names)
    return written(
        lambda path: meshio.write(path, whole, file_format="gmsh22", binary=False), ".msh"
    )


def step() -> bytes:
    from beadwave.geometry.cad.occ import write_step  # loads gmsh
    from beadwave.geometry.cad.shapes import Box, Cylinder

    bodies = {
        "plate": Box((0.1, 0.1, 0.01)),
        "boss": Cylinder(radius=0.02, length=0.03, at=(0.0, 0.0, 0.02)),
    }
    return written(lambda path: write_step(bodies, path), ".step")
