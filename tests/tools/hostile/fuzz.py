"""Changed scenes and files at random: each is read, or refused in one sentence within ten seconds.

    python tests/tools/hostile/fuzz.py [COUNT] [SEED] [KIND ...]

Takes COUNT inputs (10 000) in turn of all kinds: scenes, records, hammer tests, shapes, walls,
meshes and STEP in their formats (see `kinds`). Prints what ended otherwise, keeps that input in
fuzz-KIND-NUMBER.*, and exits with 1. The same seed makes the same inputs.
"""

import os
import re
import signal
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from importlib.util import find_spec
from io import StringIO
from multiprocessing import Pipe, get_context
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from beadwave import rom
from beadwave.workflows.files import hammer
from beadwave.workflows.files.measured_shape import measured_shape
from beadwave.workflows.files.mesh_reader import volumes_of
from beadwave.workflows.files.scene import built_in, scene, scene_text
from beadwave.workflows.files.wall_file import loaded
from beadwave.workflows.fit.measured_record import measured, recorded
from beadwave.workflows.scene import InvalidScene, RomWall
from beadwave.workflows.stages.chain.impact import require_start
from beadwave.workflows.stages.structure.bodies import drawing

from hostile import samples

SECONDS, STUCK = 10, 600  # of processors, children included; of the clock, beside other jobs
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
    apart: bool = False  # by a library that may crash: in a process of its own


def kinds() -> dict[str, Kind]:
    """Every format that a user's file may have, and that what is installed reads."""
    scenes = tuple(scene_text(name).text.encode() for name in built_in())
    known = {
        "scene": Kind(".toml", scenes, read_scene),
        "velocities": Kind(".csv", (samples.velocities(),), measured),
        "velocities-mat": Kind(".mat", (samples.velocities_mat(),), measured),
        "signals": Kind(".csv", (samples.signals(),), recorded),
        "hammer": Kind(".csv", (samples.hammer_csv(),), read_hammer),
        "wall": Kind(".npz", (samples.wall(rom.save_npz, ".npz"),), read_wall),
        "wall-mat": Kind(".mat", (samples.wall(rom.save_mat, ".mat"),), read_wall),
        "wall-mtx": Kind(".mtx", (samples.substructure(),), read_substructure),
        "mesh": Kind(".msh", (samples.mesh(),), volumes_of),
        "step": Kind(".step", (samples.step(),), read_step, apart=True),
    }
    if find_spec("pyuff"):
        known["hammer-uff"] = Kind(".uff", (samples.hammer_uff(),), read_hammer)
        known["shapes"] = Kind(".uff", samples.shapes(), read_shape)
    if find_spec("h5py"):
        known["wall-h5"] = Kind(".h5", (samples.wall(rom.save_h5, ".h5"),), read_wall)
    return known


def read_hammer(path: Path) -> object:
    """The responses of a hammer test."""
    return hammer.measured_test([path])


def read_scene(path: Path) -> None:
    """Load it, and ask whether its chain can start."""
    found = scene(path)
    if found.chain is not None:
        require_start(found)


def read_wall(path: Path) -> object:
    """The reduced model of a file."""
    return loaded(RomWall(kind="rom", file=str(path)))


def read_substructure(path: Path) -> object:
    """The reduced model of an Abaqus file."""
    return loaded(RomWall(kind="rom", file=str(path), nodes=(7, 8), direction=1))


def read_shape(path: Path) -> object:
    """The measured shape near a resonance."""
    return measured_shape(path, samples.RESONANCE_HZ)


def read_step(path: Path) -> None:
    """Its bodies."""
    assembly = {"step": str(path), "held": [], "material": "steel"}
    steel = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
    with drawing(scene({"name": "cad", "assembly": assembly, "materials": {"steel": steel}})):
        pass


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
    """The fault in how a file is read, None if it is read or refused in a sentence."""
    if not kind.apart:
        return _fault(kind, path)
    receiver, sender = Pipe(duplex=False)
    reader = get_context("fork").Process(target=lambda: sender.send(_fault(kind, path)))
    reader.start()
    reader.join(2 * STUCK)
    if reader.exitcode == 0:
        return receiver.recv()
    reader.kill()
    return f"ends its process ({reader.exitcode})"


def _fault(kind: Kind, path: Path) -> str | None:
    handler = signal.signal(signal.SIGALRM, _too_slow)
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
        signal.signal(signal.SIGALRM, handler)
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
