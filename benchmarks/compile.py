"""Variants that numba compiles for a scene's impact, with the processor seconds of each.

You will see each compiled function, the number of its variants and their seconds, then the sum
beside the seconds of the whole first impact with its imports. A variant is a function for one tuple
of argument types. Types are inferred through calls, so a function is compiled in the middle of its
caller: its own seconds are without those of the functions that it calls. LLVM optimises each
function by itself and again within each of its callers.

Run it: python benchmarks/compile.py [SCENE]        half a minute, rig-rom by default

The impact runs in a child with an empty cache: here some functions are compiled already.
"""

import json
import subprocess
import sys
from collections import Counter
from os import environ
from tempfile import TemporaryDirectory
from time import process_time

from beadwave.workflows.report.tables import Table, text

COLUMNS = ("function", "variants", "processor [s]")


def main(name: str = "rig-rom") -> list[tuple[str, str, float]]:
    """Print the table of a scene; returns function, argument types and seconds of each variant."""
    with TemporaryDirectory() as cache:
        ended = subprocess.run(
            [sys.executable, __file__, "--child", name], capture_output=True, check=True,
            env=environ | {"NUMBA_CACHE_DIR": cache}, encoding="utf-8",
        )  # fmt: skip
    record = json.loads(ended.stdout.splitlines()[-1])
    variants = [tuple(variant) for variant in record["variants"]]

    seconds_of, count_of = Counter(), Counter(function for function, _, _ in variants)
    for function, _, seconds in variants:
        seconds_of[function] += seconds
    rows = tuple((f, count_of[f], s) for f, s in seconds_of.most_common())
    again = len(variants) - len({variant[:2] for variant in variants})
    print(text(Table("compile", COLUMNS, rows)))
    print(
        f"\n{name}: {len(variants)} variants of {len(rows)} functions take "
        f"{seconds_of.total():.1f} s of the processor, of {record['impact']:.1f} s for the first "
        f"impact with its imports; {again} were compiled for argument types that they had been "
        "compiled for"
    )
    return variants


def compiled_for(name: str) -> None:
    """Compile everything that the scene's impact enters, into the cache that the environment names;
    prints a line of JSON."""
    from joblib import Memory
    from numba.core.event import Listener, register

    from beadwave.workflows.files.scene import scene
    from beadwave.workflows.stages.engine.pipeline import Pipeline

    variants, callers = [], []  # callers being compiled: start, seconds of their callees

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
    Pipeline(scene(name, ()), Memory(None, verbose=0)).compute("compilation")
    print(json.dumps({"impact": process_time() - start, "variants": variants}))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        compiled_for(sys.argv[2])
    else:
        main(*sys.argv[1:])
