"""Kills runs at many moments and damages what they keep: no input changes, nothing is half.

    python tests/tools/hostile/kills.py [COUNT]

Each kill hits a run of its own folder at a moment drawn anew, by SIGKILL, SIGINT or SIGTERM in
turn. What the folder then holds must be whole, the same command must go on to the end, and its
answer must be that of a run which nobody disturbed. At last the machine code and the results that
are kept are cut, emptied or filled with rubbish: the answer stays. Exits with 1 and a sentence at
the first of these that fails.
"""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from random import Random
from signal import SIGINT, SIGKILL, SIGTERM, default_int_handler, signal
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from beadwave import rom

COMMAND = (sys.executable, "-P", "-m", "beadwave", "run", "mine.toml", "--quiet")
SCENE = """name = "mine"
[chain]
count = 5
radius = 0.0127
density = 7800.0
young = 210e9
poisson = 0.3
[striker]
velocity = 0.31
[wall]
kind = "rom"
file = "out/wall.npz"
[output]
spheres = [1, 4]
[time]
duration = 1e-3
"""
KILLS = (SIGKILL, SIGINT, SIGTERM)
RUBBISH = (b"", b"\x80\x05no pickle" * 9, None)  # None: cut in two


def main(count: int) -> None:
    """Kill `count` runs, then damage what is kept."""
    # in the background it inherits an ignored Ctrl-C, and so would the runs
    signal(SIGINT, default_int_handler)
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        os.environ["NUMBA_CACHE_DIR"] = str(Path("numba").absolute())
        inputs = made_inputs()
        finished("undisturbed", "cache")
        began = perf_counter()
        finished("timed", "cache-of-the-timed")
        lasts = perf_counter() - began
        moments = Random(10)
        for i in range(count):
            killed(KILLS[i % len(KILLS)], lasts * moments.random(), inputs)
        damaged()
        require(inputs == contents(inputs), "an input has changed")
        print(f"{count} kills within {lasts:.1f} s, all that is kept damaged: nothing lost.")


def made_inputs() -> dict[Path, bytes]:
    """A scene, and a wall that lies in the very folder that is written to."""
    Path("mine.toml").write_text(SCENE)
    Path("out").mkdir()
    K = 2e8 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    w = np.eye(6)[0]
    rom.save_npz(Path("out/wall.npz"), rom.full_order(K, 0.4 * np.eye(6), w))
    Path("out/notes.txt").write_text("mine")
    return contents([Path("mine.toml"), Path("out/wall.npz"), Path("out/notes.txt")])


def contents(paths) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in paths}


def started(out: str, cache: str) -> subprocess.Popen:
    environment = {**os.environ, "BEADWAVE_CACHE_DIR": str(Path(cache).absolute())}
    command = [*COMMAND, f"--out={out}"]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL,
                            stderr=subprocess.PIPE, text=True, start_new_session=True)  # fmt: skip


def finished(out: str, cache: str) -> None:
    """A run to its end; it says nothing but warnings."""
    process = started(out, cache)
    said = process.communicate()[1]
    require(process.returncode == 0, f"status {process.returncode}: {said}")
    foreign = [line for line in said.splitlines() if not line.startswith(("warning: ", "replaced"))]
    require(not foreign, f"said {foreign}")


def killed(number: int, moment: float, inputs: dict[Path, bytes]) -> None:
    """A run that is killed, what it leaves, and the run that goes on."""
    complete = Path("out/summary.json").exists()
    process = started("out", f"cache-{moment}")
    try:
        said = process.communicate(timeout=moment)[1]
    except subprocess.TimeoutExpired:
        process.send_signal(number)
        said = process.communicate()[1]
    where = f"signal {number} after {moment:.3f} s"
    require(inputs == contents(inputs), f"{where}: an input has changed")
    for path in Path("out").rglob("*"):
        require(whole(path), f"{where}: {path} is half")
    putting = any(Path("out").glob(".beadwave-new-*/report.html"))  # in place of the old ones
    if complete and not putting:
        require(Path("out/report.html").exists(), f"{where}: a finished run has lost its report")
        require_answer("out", where)
    if number != SIGKILL and Path("out/scene.toml").exists() and process.returncode:
        require(process.returncode == 128 + number, f"{where}: status {process.returncode} {said}")
        require(said.count("\n") == 1, f"{where}: said {said}")
    finished("out", f"cache-{moment}")
    require(inputs == contents(inputs), f"{where}: an input has changed by the run that goes on")
    require(not list(Path("out").rglob(".beadwave-*")), f"{where}: a half file stays")
    require_answer("out", where)


def damaged() -> None:
    """A run upon kept results and kept machine code, all of them damaged."""
    kept = [*Path("numba").rglob("*.nb[ic]"), *Path("cache").rglob("*.pkl")]
    require(len(kept) > 10, f"{len(kept)} files are kept")
    for i, path in enumerate(kept):
        rubbish = RUBBISH[i % len(RUBBISH)]
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2] if rubbish is None else rubbish)
    finished("damaged", "cache")
    require_answer("damaged", "damage")


def whole(path: Path) -> bool:
    """True of a complete file; one that bears the mark of a part says that it is not."""
    if path.is_dir() or path.name.startswith(".beadwave"):
        return True
    match path.suffix:
        case ".npz":
            return zipfile.ZipFile(path).testzip() is None
        case ".json":
            return bool(json.loads(path.read_text()))
        case ".png":
            return path.read_bytes().endswith(b"IEND\xaeB`\x82")
        case ".html":
            return path.read_text().rstrip().endswith("</html>")
    return path.stat().st_size > 0


def require_answer(out: str, where: str) -> None:
    """The trajectory of the run that nobody disturbed."""
    with np.load("undisturbed/trajectory.npz") as right, np.load(f"{out}/trajectory.npz") as found:
        same = all(np.array_equal(right[name], found[name]) for name in right.files)
    require(same, f"{where}: another answer")


def require(holds: bool, sentence: str) -> None:
    if not holds:
        sys.exit(f"kills.py: {sentence}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 12)
