"""Results before and after a change that moves code and must not change numbers.

    python tests/tools/unchanged.py freeze before             # on the code as it was: an hour
    python tests/tools/unchanged.py compare before runs fits  # on the changed code: some, or all

Every command below runs in a folder of its own under the folder named, on the code that
`python -m beadwave` finds (PYTHONPATH). `compare` runs them again beside it and prints each number
that differs by more than 1e-12 of the largest in its array, each text and file that differs, and
exits with 1 if there is any. Seconds, memory, dates, versions and paths are left out; pictures
follow from the numbers and are not compared.
"""

import argparse
import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
from scipy.io import loadmat

import beadwave

TOLERANCE = 1e-12  # of the largest number of an array: rounding of another order of summation

SCENES = list(beadwave.scenes())
VERIFIED = [name for name in beadwave.studies("verify") if name != "thesis-tables"]  # minutes

# group -> name -> arguments of the command; {} is the folder of all results of this freeze
COMMANDS: dict[str, dict[str, str]] = {
    "runs": {scene: f"run {scene} --out run" for scene in SCENES},
    "structures": {
        "modes": "modes rig-rom --json",
        "table-5.2": "modes --table 5.2 --json",
        "table-5.3": "modes --table 5.3 --json",
        # the scene has no targets: computed at 1213 and 1733 Hz, its modes are to be softer
        "tune": "tune plate-on-bolts --match 1=1200,2=1700 --free joints.bolts.kz "
        "--out tuned.toml --json",
        "look": "look plate-on-bolts --json",
        "reduce": "reduce cantilever --out rom.npz --json",
        "reduce-mat": "reduce cantilever --out rom.mat --json",
        "abaqus": "modes cantilever --inp cantilever.inp",
    },
    "fits": {
        "chain": "run rig-1dof --out record --set wall.frequency=240 "
        "--set contact.stiffness_factor=[1.03,.95,.91,.9,1.06,1.08,1.02,1.05,1.01,1.09,1.06,.9,"
        "1.07,.91,1.05,.93,1.0] --set output.sensors=["
        + ",".join(f'{{sphere={n},quantity="velocity",noise=3e-4}}' for n in (1, 4, 14))
        + "]",
        "calibrate": "calibrate rig-1dof {}/fits/chain/record/signals.csv --out fit --json",
        "record": "run sensed-beam --set beam.thickness=10.3e-3 --out record",
        "inspect": "inspect sensed-beam {}/fits/record/record/signals.csv "
        "--find beam.thickness --out found --json",
        "design": "design sensed-beam --find beam.thickness,beam.young --json",
    },
    "sweeps": {
        "grid": "sweep rig-1dof --over striker.velocity=0.1:1:6:log "
        "--over chain.radius=8mm:15mm:5 --out swept",
        "sobol": "sweep rig-rigid --over striker.velocity=0.1:1 --over chain.radius=8mm:15mm "
        "--sample sobol:16 --out swept",
        "scan": "scan cantilever --grid 3x3 --out scanned",
    },
    "evidence": {
        "stability": "stability --json",
        "verify": "verify --json " + " ".join(f"--group {group}" for group in VERIFIED),
    },
}
CHANGING = re.compile(
    r"second|elapsed|memory|bytes|date|time_of|version|machine|processor|folder|path|cache|written"
    r"|checksum|command|python|platform|commit|kept|computed_at"
    r"|^stages$"  # in the order in which two processes happen to end them
)
TEXTS = {".toml", ".inp", ".md"}


def run(folder: Path, groups: list[str]) -> None:
    """Every command of these groups, in a folder of its own with its output and status."""
    for group in groups:
        for name, arguments in COMMANDS[group].items():
            place = folder / group / name
            place.mkdir(parents=True, exist_ok=True)
            words = arguments.replace("{}", str(folder.resolve())).split()
            command = [sys.executable, "-m", "beadwave", *words, "--quiet"]
            done = subprocess.run(command, cwd=place, capture_output=True, text=True)
            output = "out.json" if "--json" in words else "out.txt"
            (place / output).write_text(done.stdout)
            (place / "status.json").write_text(json.dumps({"status": done.returncode}))
            # a command that refuses its input leaves nothing to compare
            refused = f", compares nothing: {done.stderr.strip()}" if done.returncode == 2 else ""
            print(f"{group} {name}: {done.returncode}{refused}", flush=True)


def contents(path: Path) -> dict[str, object]:
    """Arrays and texts of a file by name."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return dict(arrays)
    if path.suffix == ".parquet":
        table = pandas.read_parquet(path)
        return {name: table[name].to_numpy() for name in table if not CHANGING.search(name)}
    if path.suffix == ".mat":
        return {k: v for k, v in loadmat(path, spmatrix=False).items() if not k.startswith("__")}
    if path.suffix == ".json":
        text = path.read_text()
        return dict(leaves(json.loads(text), "")) if text.strip() else {}
    if path.suffix == ".csv":
        rows = list(csv.reader(path.read_text().splitlines()))
        heads = [*rows[0], *[""] * max(map(len, rows))] if rows else []
        return {f"row {i}, column {j} {heads[j]}": cell for i, row in enumerate(rows)
                for j, cell in enumerate(row) if not CHANGING.search(heads[j])}  # fmt: skip
    if path.suffix in TEXTS:
        return {"text": path.read_text()}
    return {}


def leaves(value, name: str):
    """Numbers and texts of a JSON value by their dotted names, without those that change."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not CHANGING.search(key.lower()):
                yield from leaves(inner, f"{name}.{key}")
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from leaves(inner, f"{name}[{i}]")
    else:
        yield name, value


def number(value) -> np.ndarray | None:
    """The value as an array of numbers, complex ones kept; None for a text."""
    try:
        array = np.asarray(value)
        return array.astype(complex if np.iscomplexobj(array) else float)
    except (TypeError, ValueError):
        return None


def difference(before, after) -> float | str | None:
    """Difference of two values, relative to the largest; None where there is none."""
    one, other = number(before), number(after)
    if one is None or other is None:
        return None if str(before) == str(after) else f"{before!r:.80} {after!r:.80}"
    if one.shape != other.shape:
        return f"shape {one.shape} {other.shape}"
    if not one.size or np.array_equal(one, other, equal_nan=True):
        return None
    if not np.array_equal(np.isfinite(one), np.isfinite(other)):
        return "not finite in one of them"
    finite = np.isfinite(one)
    if not np.array_equal(one[~finite], other[~finite], equal_nan=True):
        return "infinite otherwise"
    off = np.abs(one - other)[finite].max() / np.abs(one[finite]).max(initial=1e-300)
    return float(off) if off > TOLERANCE else None


def compare(before: Path, after: Path, groups: list[str]) -> int:
    """Print what differs; returns how many values do."""
    count = 0
    for group in groups:
        for name in COMMANDS[group]:
            files, new = (
                {
                    path.relative_to(top)
                    for path in (top / group / name).rglob("*")
                    if path.is_file()
                }
                for top in (before, after)
            )
            wrong = [f"only {'before' if p in files else 'after'}: {p}" for p in files ^ new]
            for path in sorted(files & new):
                old, now = contents(before / path), contents(after / path)
                wrong += [f"{path} {key}: only in one" for key in old.keys() ^ now.keys()]
                for key in old.keys() & now.keys():
                    if (off := difference(old[key], now[key])) is not None:
                        wrong.append(f"{path} {key}: {off}")
            print(f"{group} {name}: {len(wrong)} differences in {len(files)} files", flush=True)
            print("".join(f"    {line}\n" for line in sorted(wrong)[:20]), end="")
            count += len(wrong)
    return count


def main() -> int:
    """See the docstring of the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["freeze", "compare"])
    parser.add_argument("place", type=Path, help="folder of the results before")
    parser.add_argument(
        "groups", nargs="*", metavar="group", help=f"{', '.join(COMMANDS)}; all without"
    )
    given = parser.parse_args()
    groups = given.groups or list(COMMANDS)
    if unknown := [group for group in groups if group not in COMMANDS]:
        parser.error(f"no group {unknown[0]!r}; take {', '.join(COMMANDS)}")
    if given.what == "freeze":
        run(given.place, groups)
        return 0
    if not given.place.is_dir():
        parser.error(f"no folder {given.place}; freeze it first, on the code as it was")
    after = given.place.with_name(f"{given.place.name}-after")
    run(after, groups)
    return int(compare(given.place, after, groups) > 0)


if __name__ == "__main__":
    sys.exit(main())
