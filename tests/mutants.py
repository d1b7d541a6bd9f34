"""Mutants of the numerical modules: small errors, one at a time, that the tests should notice.

    python tests/mutants.py [COUNT] [SEED] [MODULE ...]

Draws COUNT mutants (20) of the modules below, in turn, writes each into a copy of the sources and
runs the tests beside the module's name up to the first that fails. A mutant whose tests all pass
has survived: it is printed with its line, before and after. Prints the share that was noticed.
"""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
TESTS = {  # module: tests that run for its mutants
    "dem/kernels/laws.py": ("dem_plastic", "dem_damping", "dem_chain", "workflows_verify"),
    "dem/kernels/explicit.py": ("dem_chain", "dem_plastic", "workflows_verify"),
    "dem/statics.py": ("dem_extremes", "dem_chain", "workflows_verify"),
    "rom/craig_bampton.py": ("rom_reduction",),
    "rom/free_modes.py": ("rom_reduction",),
    "rom/truncation.py": ("rom_reduction",),
    "rom/reduced_model.py": ("rom_reduction", "rom_health"),
    "fem/joints.py": ("fem_joints", "fem_mechanisms"),
    "fem/contact_patch.py": ("fem_half_space", "fem_theory"),
    "coupling/wall.py": ("coupling_wall", "coupling_march"),
    "coupling/damping.py": ("coupling_wall", "coupling_march"),
    "coupling/coupled_march.py": ("coupling_march",),
    "coupling/calibration/fitting.py": ("coupling_calibration",),
    "coupling/calibration/uncertainty.py": ("coupling_calibration",),
}
COPIED = (
    "geometry", "fem", "rom", "dem", "coupling", "workflows", "tests", "beadwave.py",
    "pyproject.toml",
)  # fmt: skip
SECONDS = 900  # of the tests of one mutant: endless ones are noticed as well
SWAPS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.LtE,
    ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And, ast.USub: ast.UAdd, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip


class Mutant(NamedTuple):
    """A module's source with one small error, the line, before and after."""

    source: str
    line: int
    before: str
    after: str


def size(source: str) -> int:
    """How many mutants a module has."""
    return sum(1 for _ in _places(ast.parse(source)))


def mutant_of(source: str, i: int) -> Mutant:
    """The i-th mutant of a module, in the order of its syntax."""
    tree = ast.parse(source)
    node, change = [*_places(tree)][i]
    before = ast.unparse(node)
    change(node)
    return Mutant(ast.unparse(tree), node.lineno, before, ast.unparse(node))


def _places(tree: ast.Module) -> Iterator[tuple[ast.expr, Callable]]:
    """Expressions within functions that can be changed, and how."""
    functions = (f for f in ast.walk(tree) if isinstance(f, ast.FunctionDef))
    for statement in (s for f in functions for s in f.body if not _is_text(s)):
        for node in ast.walk(statement):
            if isinstance(node, ast.BinOp | ast.UnaryOp | ast.BoolOp) and type(node.op) in SWAPS:
                yield node, _swap
            if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
                yield node, _compare
            if isinstance(node, ast.Constant) and type(node.value) in (int, float):
                yield node, _count


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Raise) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )


def _swap(node) -> None:
    node.op = SWAPS[type(node.op)]()


def _compare(node) -> None:
    node.ops[0] = SWAPS[type(node.ops[0])]()


def _count(node) -> None:
    node.value = node.value + 1 if isinstance(node.value, int) else 1.5 * node.value or 1.0


def survives(mutant: Mutant, module: str, copy: Path) -> bool:
    """Whether all tests of the module pass with the mutant in its place."""
    place = copy / module
    good = place.read_text()
    place.write_text(mutant.source)
    try:
        return passes(module, copy)
    finally:
        place.write_text(good)


def passes(module: str, copy: Path) -> bool:
    """Whether all tests of a module pass in a copy of the sources."""
    tests = [f"tests/test_{name}.py" for name in TESTS[module]]
    one = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
    kept = {"NUMBA_CACHE_DIR": str(copy / "kept"), "BEADWAVE_CACHE_DIR": str(copy / "results")}
    try:
        return not subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests],
            cwd=copy, capture_output=True, timeout=SECONDS,
            env=os.environ | dict.fromkeys(one, "1") | kept | {"PYTHONPATH": str(copy)},
        ).returncode  # fmt: skip
    except subprocess.TimeoutExpired:
        return False


def main(count: int = 20, seed: int = 1, modules: tuple[str, ...] = ()) -> None:
    """Draw, run and count."""
    chance, noticed = Random(seed), 0
    modules = modules or tuple(TESTS)
    with TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED:
            into = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            into(ROOT / name, copy / name)
        for i in range(count):
            module = modules[i % len(modules)]
            if i < len(modules) and not passes(module, copy):
                sys.exit(f"the tests of {module} fail without a mutant; mend them first.")
            source = (ROOT / module).read_text()
            mutant = mutant_of(source, chance.randrange(size(source)))
            alive = survives(mutant, module, copy)
            noticed += not alive
            mark = "SURVIVED" if alive else "noticed"
            print(f"{mark} {module}:{mutant.line}  {mutant.before}  ->  {mutant.after}", flush=True)
    print(f"{noticed} of {count} noticed, {noticed / count:.0%}.")


if __name__ == "__main__":
    words = sys.argv[1:]
    numbers = [int(word) for word in words if word.isdigit()]
    main(*numbers, modules=tuple(word for word in words if not word.isdigit()))
