"""Changed scenes and files at random: each is read, or refused in one sentence within ten seconds.

    python tests/hostile/fuzz.py [COUNT] [SEED] [KIND ...]

Takes COUNT inputs (10 000) in turn of all kinds: scene, velocities, hammer, wall, mesh in their
formats. Prints what ended otherwise, keeps that input in fuzz-KIND-NUMBER.*, and exits with 1. The
same seed makes the same inputs.
"""

import os
import re
import signal
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import BytesIO, StringIO
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

import meshio
import numpy as np
from scipy.io import savemat

import rom
from workflows.files import hammer
from workflows.files.mesh import volumes_of
from workflows.files.scene import built_in, scene, scene_text
from workflows.files.velocities import record
from workflows.files.wall import loaded
from workflows.pipeline.impact import require_start
from workflows.scene import InvalidScene, RomWall

SECONDS, STUCK = 10, 60  # of processors, children included; of the clock
NUMBERS = (
    "0", "-1", "1e-300", "1e300", "1e400", "inf", "-inf", "nan", "1e9", "0.5", "true", '"x"', "[]",
    "[1, 2]", "{}", '"3 ms"', "99999999999999999999", "1_0", "0x10", "1979-05-27", "[[1]]",
)  # fmt: skip
NUMBER = re.compile(rb"-?\d+\.?\d*(?:e[+-]?\d+)?")


class Slow(BaseException):
    """Beyond the seconds that an input may take."""


class Kind(NamedTuple):
    """Good files of a format, and what reads one."""

    ending: str
    samples: tuple[bytes, ...]
    read: Callable[[Path], object]


def kinds() -> dict[str, Kind]:
    """Every format that a user's file may have."""
    scenes = tuple(scene_text(name).text.encode() for name in built_in())
    return {
        "scene": Kind(".toml", scenes, read_scene),
        "velocities": Kind(".csv", (_velocities(),), record),
        "velocities-mat": Kind(".mat", (_velocities_mat(),), record),
        "hammer": Kind(".csv", (_written(hammer.write_csv, ".csv"),), hammer.responses),
        "wall": Kind(".npz", (_wall(rom.save_npz, ".npz"),), read_wall),
        "wall-mat": Kind(".mat", (_wall(rom.save_mat, ".mat"),), read_wall),
        "mesh": Kind(".msh", (_mesh(),), volumes_of),
    }


def read_scene(path: Path) -> None:
    """Load it, and ask whether its chain can start."""
    found = scene(path)
    if found.chain is not None:
        require_start(found)


def read_wall(path: Path) -> object:
    """The reduced model of a file."""
    return loaded(RomWall(kind="rom", file=str(path)))


def _velocities() -> bytes:
    t = 1e-2 * np.arange(80)
    table = np.column_stack([t, np.sin(t), np.cos(t)])
    lines = (",".join(f"{x:.6g}" for x in row) for row in table)
    return "\n".join(["# a title", "time [ms], sphere 1 [mm/s], sphere 4 [mm/s]", *lines]).encode()


def _velocities_mat() -> bytes:
    file, t = BytesIO(), 1e-5 * np.arange(80)
    held = {"t": t, "v": np.column_stack([t, t]), "spheres": [1, 4]}
    savemat(file, held | {"time_unit": "s", "velocity_unit": "m/s"})
    return file.getvalue()


def _written(write: Callable, ending: str) -> bytes:
    f = np.linspace(10.0, 1000.0, 60)
    test = hammer.Responses(f, np.array([1.0 / (300.0**2 - f**2 + 30j * f)]), "a test")
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"sample{ending}"
        write(path, test)
        return path.read_bytes()


def _wall(save: Callable, ending: str) -> bytes:
    K = 1e8 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    reduced = rom.full_order(K, 0.4 * np.eye(6), np.eye(6)[-1])
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"sample{ending}"
        save(path, reduced)
        return path.read_bytes()


def _mesh() -> bytes:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
    tags = {name: [np.array([1, 1])] for name in ("gmsh:physical", "gmsh:geometrical")}
    cells, names = [("tetra", np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))], {"block": np.array([1, 3])}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sample.msh"
        mesh = meshio.Mesh(points, cells, cell_data=tags, field_data=names)
        meshio.write(path, mesh, file_format="gmsh22", binary=False)
        return path.read_bytes()


def changed(good: bytes, chance: Random) -> bytes:
    """One to four changes: numbers, lines, bytes, ends."""
    for _ in range(chance.randint(1, 4)):
        good = chance.choice((_number, _number, _line, _byte, _cut, _swapped))(good, chance)
    return good


def _number(text: bytes, chance: Random) -> bytes:
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    one = chance.choice(found)
    return text[: one.start()] + chance.choice(NUMBERS).encode() + text[one.end() :]


def _line(text: bytes, chance: Random) -> bytes:
    """A line more or less."""
    lines = text.split(b"\n")
    at = chance.randrange(len(lines))
    lines[at : at + 1] = [lines[at]] * chance.choice((0, 2))
    return b"\n".join(lines)


def _byte(text: bytes, chance: Random) -> bytes:
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.randbytes(chance.randint(1, 3)) + text[at + chance.randint(0, 3) :]


def _cut(text: bytes, chance: Random) -> bytes:
    return text[: chance.randrange(len(text) + 1)] if chance.random() < 0.3 else text


def _swapped(text: bytes, chance: Random) -> bytes:
    lines = text.split(b"\n")
    i, j = (chance.randrange(len(lines)) for _ in range(2))
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


def fault(kind: Kind, path: Path) -> str | None:
    """What is wrong with how a file is read, None if it is read or refused in a sentence."""
    signal.signal(signal.SIGALRM, _too_slow)
    signal.setitimer(signal.ITIMER_REAL, STUCK)
    began = sum(os.times()[:4])
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            kind.read(path)
    except InvalidScene as refusal:
        said = str(refusal)
        if not said.strip() or "\n" in said.strip():
            return f"no sentence: {said!r}"
    except Slow:
        return f"took more than {STUCK} s"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    spent = sum(os.times()[:4]) - began
    return f"took {spent:.0f} s of processors" if spent > SECONDS else None


def _too_slow(*_) -> None:
    raise Slow


def main(count: int = 10_000, seed: int = 1, names: tuple[str, ...] = ()) -> int:
    """Number of inputs that are neither read nor refused."""
    known, chance, bad = kinds(), Random(seed), 0
    with TemporaryDirectory() as folder:
        for i in range(count):
            name = [*(names or known)][i % len(names or known)]
            kind = known[name]
            path = Path(folder) / f"input-{i}{kind.ending}"
            path.write_bytes(changed(chance.choice(kind.samples), chance))
            if said := fault(kind, path):
                bad += 1
                kept = Path(f"fuzz-{name}-{i}{kind.ending}")
                kept.write_bytes(path.read_bytes())
                print(f"{kept}: {said}", flush=True)
            with suppress(OSError):
                path.unlink()
    print(f"{count} inputs of {', '.join(names or known)}, seed {seed}: {bad} at fault.")
    return bad


if __name__ == "__main__":
    arguments = sys.argv[1:]
    numbers = [int(word) for word in arguments[:2] if word.isdigit()]
    sys.exit(bool(main(*numbers, names=tuple(w for w in arguments if not w.isdigit()))))
