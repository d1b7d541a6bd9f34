"""Kept machine code: what is damaged or of other sources is compiled again, and says nothing."""

import gc
import os
import pickle
import shutil
import subprocess
import sys
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType

import numba
import pytest
from filelock import FileLock

from beadwave import coupling, dem
from beadwave.dem.kernels import kept_code as kept
from beadwave.dem.kernels import laws
from beadwave.dem.kernels.compiled import NEWEST_NUMBA, CompiledFunction, njit

PACKAGE = Path(dem.__file__).parents[1]
ROOMS = (
    *walk_packages(dem.__path__, "beadwave.dem."),
    *walk_packages(coupling.__path__, "beadwave.coupling."),
)


def twice(x):
    return x + x


def one_more_than(function):
    return lambda x: function(x) + 1.0


def compiled(argument=21.0):
    """The function as a new process would have it, and its value."""
    function = njit(error_model="numpy")(twice)
    return function, function(argument)


def loads(function):
    """Variants that were loaded, not compiled."""
    return sum(function.dispatcher.stats.cache_hits.values())


@pytest.fixture
def chosen(tmp_path, monkeypatch):
    """The folder that the user chose for numba."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "code"))
    return tmp_path / "code"


DAMAGE = {
    "cut": lambda content: content[: len(content) // 2],
    "cut at its end": lambda content: content[:-1],
    "empty": lambda content: b"",
    "rubbish": lambda content: b"\x80\x05no pickle" * 9,
    "a bit": lambda content: content[:-90] + bytes([content[-90] ^ 1]) + content[-89:],
    "another's": lambda content: content + content,
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc", ".json"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_damaged_code_is_compiled_again(damage, suffix, chosen, capfd):
    assert compiled()[1] == 42.0
    (file,) = chosen.rglob(f"*{suffix}")
    file.write_bytes(damage(file.read_bytes()))
    again, value = compiled()
    assert value == 42.0 and loads(again) == 0
    healed, value = compiled()
    assert value == 42.0 and loads(healed) == 1
    assert capfd.readouterr() == ("", "")


def test_files_of_a_process_that_was_killed_are_removed(chosen):
    """Written by numba, but not in the manifest yet."""
    compiled()
    (manifest,), (code,) = chosen.rglob("*.json"), chosen.rglob("*.nbc")
    manifest.unlink()
    stray = code.with_name(code.name.replace(".1.nbc", ".2.nbc"))
    stray.write_bytes(b"half")
    again, value = compiled()
    assert value == 42.0 and loads(again) == 0 and not stray.exists()


def test_code_that_names_a_class_of_before_is_compiled_again(chosen):
    """Its bytes are those that were written, but nothing can load them."""
    compiled()
    (manifest,), (index,) = chosen.rglob("*.json"), chosen.rglob("*.nbi")
    written = sha256(index.read_bytes()).hexdigest()
    version, rest = pickle.dumps(numba.__version__), b"cgone\nGone\n."
    index.write_bytes(version + rest)
    renamed = manifest.read_text().replace(written, sha256(version + rest).hexdigest())
    manifest.write_text(renamed)
    for hits in (0, 0, 1):  # compiled, compiled and kept, loaded
        function, value = compiled()
        assert value == 42.0 and loads(function) == hits


def test_an_error_of_the_compiler_is_raised(chosen):
    with pytest.raises(numba.TypingError):
        njit(error_model="numpy")(lambda x: x.absent)(1.0)


COMPILES = """
import sys
from beadwave.dem.kernels.laws import hertz_indentation
hertz_indentation.dispatcher
print("ready", flush=True)
value = hertz_indentation(*eval(sys.stdin.readline()))
print(sum(hertz_indentation.dispatcher.stats.cache_hits.values()), value)
"""


@pytest.mark.slow
def test_processes_that_need_a_kernel_at_once_compile_each_variant_once(tmp_path):
    """Two for numbers, two for integers, whose code numba alone would give the same name."""
    of_floats, of_integers = (2.0, 1.0, 1.0), (3, 1, 1)
    expected = [laws.hertz_indentation.py_func(*of) for of in (of_floats, of_integers)]
    for hits in ([0, 1], [1, 1]):  # from an empty folder, and once more
        processes = [
            subprocess.Popen(
                [sys.executable, "-P", "-c", COMPILES],
                env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )
            for _ in range(4)
        ]  # fmt: skip
        for process in processes:
            assert process.stdout.readline() == "ready\n"
        for process, arguments in zip(processes, 2 * (of_floats, of_integers), strict=True):
            process.stdin.write(f"{arguments}\n")
            process.stdin.flush()
        answers = [process.communicate()[0].split() for process in processes]
        for i in range(2):
            assert sorted(int(answer[0]) for answer in answers[i::2]) == hits
            # rounding of fast sums
            assert [float(answer[1]) for answer in answers[i::2]] == pytest.approx(
                2 * [expected[i]], rel=1e-14
            )


def test_a_full_disk_costs_the_next_start_only(chosen, monkeypatch):
    function = njit(error_model="numpy")(twice)
    assert function.dispatcher.signatures == []

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        assert function(21.0) == 42.0
    again, value = compiled()
    assert value == 42.0 and loads(again) == 0


def test_a_folder_that_cannot_be_made_costs_the_next_start_only(chosen):
    chosen.write_text("a file")
    assert compiled()[1] == 42.0
    again, value = compiled()
    assert value == 42.0 and loads(again) == 0


def test_a_lock_that_stays_taken_costs_the_next_start_only(chosen, monkeypatch):
    """A process that was stopped while it compiled holds it."""
    compiled()
    (lock,) = chosen.rglob("*.lock")
    function = njit(error_model="numpy")(twice)
    assert function.dispatcher.signatures == []
    monkeypatch.setattr(kept, "PATIENCE", 0.0)
    with FileLock(lock):
        assert function(21.0) == 42.0
        assert compiled()[1] == 42.0
    assert loads(function) == 0
    assert loads(compiled()[0]) == 1


def test_the_users_folder_stays_that_of_other_functions(chosen):
    compiled()
    assert numba.config.CACHE_DIR == str(chosen)
    other = numba.njit(cache=True)(twice)
    other(21.0)
    (of_other,) = chosen.glob("dem_*/*.nbc")
    assert "code-" not in str(of_other)


def test_garbage_is_collected_again_after_compiling(chosen):
    assert gc.isenabled()
    compiled()
    assert gc.isenabled()


def compiled_functions():
    named = [value for room in ROOMS for value in vars(import_module(room.name)).values()]
    return {value for value in named if isinstance(value, CompiledFunction)}


def test_the_code_of_every_function_that_python_enters_is_kept(chosen):
    assert len(compiled_functions()) > 50
    entries = {f for f in compiled_functions() if not f._inner}
    assert len(entries) > 10
    for function in entries:
        folder = kept.Entry(function.py_func, **function._options).folder
        assert folder.parents[1] == chosen


def test_a_function_within_another_keeps_no_code_of_its_own(chosen):
    """An entry from Python is no exception: its code within another's is not that of the entry."""
    for inner in (True, False):
        function = njit(error_model="numpy", inner=inner)(twice)
        entry = njit(error_model="numpy")(one_more_than(function))
        assert entry(20.5) == 42.0  # exact: small numbers of halves
        assert len(function.within.signatures) == 1
    assert not list(chosen.rglob("*twice*.nbc"))


def test_a_function_within_another_has_no_machine_code_of_its_own(chosen):
    """With a numba newer than is known it has, and the entry works."""
    function = njit(error_model="numpy", inner=True, forceinline=True)(twice)
    entry = njit(error_model="numpy")(one_more_than(function))
    assert entry(20.5) == 42.0
    (within,) = function.within.overloads.values()
    engine = within.library.codegen._engine
    is_newer = numba.version_info.short > NEWEST_NUMBA
    assert engine.is_symbol_defined(within.fndesc.llvm_func_name) == is_newer


def test_an_inner_function_called_from_python_runs_there():
    assert laws.hertz_force(4.0, 2.0) == 16.0


def reached(function):
    """Folders of the compiled functions that one names, its own included."""
    code, names = function.py_func.__code__, function.py_func.__globals__
    functions = [names[name] for name in code.co_names if name in names]
    modules = [value for value in functions if isinstance(value, ModuleType)]
    functions += [vars(module).get(name) for module in modules for name in code.co_names]
    called = [f for f in functions if isinstance(f, CompiledFunction)]
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


@pytest.mark.parametrize("argument", ["numba.config.DISABLE_JIT = True", "pass"])
def test_kernels_run_as_plain_python_where_numba_is_told_so(argument, tmp_path):
    """By NUMBA_DISABLE_JIT, or by numba's setting before the first call."""
    code = f"import numba; {argument}\n{FORCE}print(rest.dispatcher is rest.py_func)"
    disabled = {} if "config" in argument else {"NUMBA_DISABLE_JIT": "1"}
    process = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)} | disabled,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert process.stdout.split() == ["8.0", "True"] and not list(tmp_path.iterdir())


def test_code_of_a_few_states_of_the_sources_is_kept(chosen, monkeypatch):
    for state in range(kept.KEPT + 2):
        monkeypatch.setattr(kept, "fingerprint", lambda folder, state=state: f"{state}" * 64)
        assert compiled()[1] == 42.0
    (place,) = chosen.iterdir()
    assert sorted(folder.name[-1] for folder in place.iterdir()) == ["2", "3", "4"]
