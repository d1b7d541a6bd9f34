"""What numba compiles for a scene's impact: each variant and its processor seconds.

A variant is a function for one tuple of argument types. Types are inferred through calls, so a
function is compiled in the middle of its caller: its own seconds are without those of what it
calls. LLVM optimises each function by itself and again within each of its callers.
"""

import json
import sys
from collections import Counter
from os import environ
from pathlib import Path
from pickle import dumps, loads
from tempfile import TemporaryDirectory
from time import process_time

from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.files.child import child
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.pipeline import couples
from beadwave.workflows.stages.progress import Progress

SCENE = "rig-rom"
ALONE = True  # ten seconds of one core, which change with the versions of numba and LLVM only


def compile(scene: Scene, progress: Progress) -> Finding:
    """Compiled variants that the scene enters, with the processor seconds of each.

    In a child with an empty cache: here some are compiled already. Raises InvalidScene for a scene
    without a chain at a wall that is read where it is pushed.
    """
    if scene.chain is None or couples(scene):
        raise InvalidScene(
            f"{scene.name}: --stage compile needs a [chain] before a wall that is read where it is "
            "pushed; take rig-rom or rig-rigid."
        )
    with TemporaryDirectory() as folder, progress("compilation"):
        Path(folder, "scene").write_bytes(dumps(scene))
        # 600 s for the child: some 30 times what the largest variant of a chain takes
        ended = child("beadwave.workflows.evidence.accuracy.compile", folder, seconds=600.0)
        if ended.returncode:
            raise RuntimeError(ended.stderr.decode(errors="replace"))
        record = json.loads(Path(folder, "variants.json").read_text(encoding="utf-8"))

    variants = sorted(record["variants"], key=lambda variant: -variant[2])
    rows = tuple(
        AccuracyRow("compile", function, arguments, None, seconds, seconds_cold=seconds)
        for function, arguments, seconds in variants
    )
    seconds_of = Counter()
    for function, _, seconds in variants:
        seconds_of[function] += seconds
    count_of = Counter(function for function, _, _ in variants)
    functions = tuple((f, count_of[f], s) for f, s in seconds_of.most_common())
    sentences = rendered(
        __file__, scene=scene.name, functions=len(functions), variants=len(variants),
        again=len(variants) - len({variant[:2] for variant in map(tuple, variants)}),
        compiling=seconds_of.total(), impact=record["impact"],
    )  # fmt: skip
    by_function = Table("compilation", ("function", "variants", "processor [s]"), functions)
    return Finding((table_of(rows, printed=False), by_function), sentences)


def main() -> None:
    """Compile what the scene in the folder on the command line enters, in a cache of its own;
    leaves variants.json there."""
    folder = Path(sys.argv[1])
    environ["NUMBA_CACHE_DIR"] = str(folder / "code")
    scene = loads((folder / "scene").read_bytes())

    from joblib import Memory
    from numba.core.event import Listener, register

    from beadwave.workflows.stages.pipeline import Pipeline

    variants, callers = [], []  # of those that are being compiled: start, seconds of callees

    class OwnSeconds(Listener):
        """A stack of the functions that are being compiled."""

        def on_start(self, event) -> None:
            callers.append([process_time(), 0.0])

        def on_end(self, event) -> None:
            """Take the seconds of its callees off those of a function, and add them to its
            caller's."""
            start, callees = callers.pop()
            seconds = process_time() - start
            if callers:
                callers[-1][1] += seconds
            function = event.data["dispatcher"].py_func
            name = f"{function.__module__}.{function.__qualname__}"
            arguments = ", ".join(map(str, event.data["args"]))
            variants.append((name, arguments, seconds - callees))

    register("numba:compile", OwnSeconds())
    start = process_time()
    Pipeline(scene, Memory(None, verbose=0)).compute("compilation")
    record = {"impact": process_time() - start, "variants": variants}
    (folder / "variants.json").write_text(json.dumps(record), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
