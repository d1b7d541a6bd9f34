"""Kept machine code: what is damaged or of other sources is compiled again, and says nothing."""

import operator
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType

import numba
import pytest
from numba.core.registry import cpu_target
from numba.core.types import float64

from beadwave import coupling, dem
from beadwave.dem.kernels import kept_code as kept
from beadwave.dem.kernels import laws
from beadwave.dem.kernels.compiled import Compiled, njit
from beadwave.dem.kernels.kept_code import CheckedFile

PACKAGE = Path(dem.__file__).parents[1]
ROOMS = (
    *walk_packages(dem.__path__, "beadwave.dem."),
    *walk_packages(coupling.__path__, "beadwave.coupling."),
)


def twice(x):
    return x + x


def compiled():
    """The function as a new process would have it, and what it gives."""
    function = njit(error_model="numpy")(twice)
    return function, function(21.0)


DAMAGE = {
    "cut": lambda content: content[: len(content) // 2],
    "cut at its end": lambda content: content[:-1],
    "empty": lambda content: b"",
    "rubbish": lambda content: b"\x80\x05no pickle" * 9,
    "a bit": lambda content: content[:-90] + bytes([content[-90] ^ 1]) + content[-89:],
    "another's": lambda content: content + content,
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_damaged_code_is_compiled_again(damage, suffix, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert compiled()[1] == 42.0
    (file,) = tmp_path.rglob(f"*{suffix}")
    content = file.read_bytes()
    file.write_bytes(damage(content))
    again, entries = compiled()
    assert entries == 42.0 and sum(again.dispatcher.stats.cache_hits.values()) == 0
    healed, entries = compiled()
    assert entries == 42.0 and sum(healed.dispatcher.stats.cache_hits.values()) == 1
    assert capfd.readouterr() == ("", "")


def test_code_that_another_process_numbered_alike_is_not_taken_for_ones_own(tmp_path, monkeypatch):
    """Both have looked at the index before the other wrote to it."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    njit(error_model="numpy")(twice)(21.0)
    (code,), (index,) = tmp_path.rglob("*.nbc"), tmp_path.rglob("*.nbi")
    of_a_float = code.read_bytes()
    index.unlink()
    njit(error_model="numpy")(twice)(21)
    assert code.read_bytes() != of_a_float
    code.write_bytes(of_a_float)
    for hits in (0, 1):  # compiled again, and kept
        function = njit(error_model="numpy")(twice)
        assert repr(function(10**17 + 1)) == "200000000000000002"  # which no float is
        assert sum(function.dispatcher.stats.cache_hits.values()) == hits


def test_a_folder_that_takes_no_code_costs_the_next_start_only(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(CheckedFile, "_save_index", full)
    assert compiled()[1] == 42.0


def compiled_functions():
    named = [value for room in ROOMS for value in vars(import_module(room.name)).values()]
    return {value for value in named if isinstance(value, Compiled)}


def test_the_code_of_every_function_that_python_enters_is_checked():
    assert len(compiled_functions()) > 50
    entries = {f for f in compiled_functions() if not f._inner}
    assert len(entries) > 10
    assert all(isinstance(f.dispatcher._cache._cache_file, CheckedFile) for f in entries)


def test_an_inner_function_makes_no_code_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    inner = njit(error_model="numpy", inner=True)(twice)
    entry = njit(error_model="numpy")(lambda x: inner(x) + 1.0)
    assert entry(20.5) == 42.0  # exact: small numbers of halves
    (variant,) = inner.dispatcher.overloads.values()
    assert variant.library.get_pointer_to_function(variant.fndesc.llvm_func_name) == 0
    assert not list(tmp_path.rglob("*twice*.nbc"))


def test_an_operator_on_numbers_is_typed_once_and_a_function_each_time():
    """The code of `max` depends on the floating-point options of its caller, that of + does not."""
    numbas, typed = cpu_target.typing_context, []

    class Counting:
        def resolve_function_type(self, func, args, kws):
            typed.append(func)
            return numbas.resolve_function_type(func, args, kws)

    kernels = kept.KernelTyping(Counting())
    for func, times in ((operator.add, 1), (max, 2)):
        expected = numbas.resolve_function_type(
            numbas.resolve_value_type(func), (float64, float64), {}
        )
        for _ in range(2):
            function = numbas.resolve_value_type(func)
            assert kernels.resolve_function_type(function, (float64, float64), {}) == expected
        assert len(typed) == times
        typed.clear()


def test_an_inner_function_called_from_python_runs_there():
    assert laws.hertz_force(4.0, 2.0) == 16.0


def reached(function):
    """Folders of the compiled functions that one names, its own included."""
    code, names = function.py_func.__code__, function.py_func.__globals__
    functions = [names[name] for name in code.co_names if name in names]
    modules = [value for value in functions if isinstance(value, ModuleType)]
    functions += [vars(module).get(name) for module in modules for name in code.co_names]
    called = [f for f in functions if isinstance(f, Compiled)]
    return {Path(f.py_func.__code__.co_filename).parent for f in (function, *called)}


def test_compiled_code_calls_its_own_folder_and_the_kernels_alone():
    """Whose sources name the folder of its code."""
    kernels = Path(kept.__file__).parent
    for function in compiled_functions():
        folder = Path(function.py_func.__code__.co_filename).parent
        assert reached(function) <= {folder, kernels}


FORCE = """
import numpy as np
from beadwave.dem.kernels.equilibrium import Bearing, NewtonRoom, rest
room = NewtonRoom(np.zeros(2), *np.zeros((5, 1)))
bearing = Bearing(np.ones(1), np.zeros(1), np.zeros(1), np.zeros(1), 0.0)
rest(np.array([4.0]), bearing, 0.0, 0, room)
print(room.f[1])
"""


def force_of(folder, **environment):
    """Of an overlap of 4 at a contact of 1, by the sources in a folder."""
    process = subprocess.run(
        [sys.executable, "-P", "-c", FORCE],
        env=os.environ | {"PYTHONPATH": str(folder)} | environment,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return float(process.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [False, True], ids=["beside the sources", "NUMBA_CACHE_DIR"])
def test_an_edited_contact_law_changes_the_force_that_another_file_computes(chosen, tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "beadwave", ignore=shutil.ignore_patterns("__pycache__"))
    place = {"NUMBA_CACHE_DIR": str(tmp_path / "code")} if chosen else {}
    assert force_of(tmp_path, **place) == 8.0
    laws = tmp_path / "beadwave" / "dem" / "kernels" / "laws.py"
    law = laws.read_text(encoding="utf-8")
    assert law.count("return A * d * math.sqrt(d)") == 1
    laws.write_text(law.replace("return A * d", "return 3.0 * A * d"), encoding="utf-8")
    assert force_of(tmp_path, **place) == 24.0


def test_code_of_a_few_states_of_the_sources_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    for state in range(kept.KEPT + 2):
        monkeypatch.setattr(kept, "fingerprint", lambda folder, state=state: f"{state}" * 64)
        assert compiled()[1] == 42.0
    (place,) = tmp_path.iterdir()
    assert sorted(folder.name[-1] for folder in place.iterdir()) == ["2", "3", "4"]
