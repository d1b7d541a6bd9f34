"""Options of the whole run, fixtures that files share.

`pytest` without a file takes every core and leaves out the tests marked slow, peer or minutes,
`pytest --all` only those marked minutes; where files are named, all of their tests run in one
process.
"""

import sys
from os import environ, sched_getaffinity
from subprocess import CompletedProcess

import pytest

# before anything loads BLAS: its threads fight over the small blocks of sparse factors
environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# a second process of a command imports for 2 s, and tests fill the cores
environ.setdefault("BEADWAVE_PROCESSES", "1")
pytest_plugins = ["signal_guard"]
MOST_WORKERS = 8  # each holds up to 1 GB


def pytest_addoption(parser):
    """`--all` runs the slow tests too, `--part` some of the files, `--rows` keeps comparisons."""
    parser.addoption(
        "--all", action="store_true", help="run the tests that are marked slow or peer too"
    )
    parser.addoption("--part", metavar="K/N", help="run the Kth of N parts of the files of tests")
    parser.addoption("--rows", metavar="FILE", help="add the comparisons of tests/verify to a CSV")


@pytest.hookimpl(tryfirst=True)  # before xdist reads the number of workers
def pytest_cmdline_main(config):
    """A run of the whole suite, unless its options say otherwise."""
    option = config.option
    if config.args_source is not config.ArgsSource.TESTPATHS:
        return
    if not option.markexpr:
        option.markexpr = "not minutes" if option.all else "not (slow or peer or minutes)"
    if hasattr(config, "workerinput") or option.usepdb or option.collectonly:
        return
    if config.pluginmanager.hasplugin("xdist"):
        if option.numprocesses is None:
            option.numprocesses = min(len(sched_getaffinity(0)), MOST_WORKERS)
        if option.dist == "no" and option.numprocesses:
            # halves of the list in its order: what a file shares is computed once, but for the one
            # where the halves meet and those that are taken over at the end
            option.dist = "worksteal"


@pytest.hookimpl(trylast=True)  # of the files of which the markers leave something
def pytest_collection_modifyitems(config, items):
    """`--part K/N` runs every Nth of the files of tests, from the Kth on."""
    if part := config.option.part:
        k, n = map(int, part.split("/"))
        files = sorted({item.location[0] for item in items})[k - 1 :: n]
        other = [item for item in items if item.location[0] not in files]
        config.hook.pytest_deselected(items=other)
        items[:] = [item for item in items if item.location[0] in files]


@pytest.fixture(autouse=True)
def no_lines_of_progress(monkeypatch):
    """Stages that take over a second say so on stderr, which depends on the machine."""
    monkeypatch.setattr("beadwave.workflows.commands.terminal.PATIENCE", 1e4)


@pytest.fixture(autouse=True)
def variables_of_before():
    """A command sets variables of its process; left there, PYTHONSAFEPATH hid the modules beside a
    script from the script that a later test ran."""
    before = dict(environ)
    yield
    for name in environ.keys() - before.keys():
        del environ[name]
    environ.update(before)


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """A test works in a folder of its own, and keeps results there."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def module_folder(tmp_path_factory):
    """All tests of a file work in this folder, and keep results there."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        path = tmp_path_factory.mktemp("module")
        monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(path / "cache"))
        monkeypatch.chdir(path)
        yield path


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache of results that the tests of a file share."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def shared_cache(cache, tmp_path, monkeypatch):
    """The commands of a test keep their results there, and work in a folder of their own."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(cache))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def rig_cache(tmp_path_factory):
    """A cache of results of the coarse rig, which several files run."""
    return tmp_path_factory.mktemp("rig-cache")


@pytest.fixture(scope="session")
def coarse_run(rig_cache, tmp_path_factory):
    """The folder of a run of the coarse rig with 30 modes."""
    from command_line import COARSE_RUN, beadwave

    folder = tmp_path_factory.mktemp("rig")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BEADWAVE_CACHE_DIR", str(rig_cache))
        changes = (f"--set={change}" for change in COARSE_RUN)
        assert beadwave("run", "rig-rom", f"--out={folder}", *changes) == 0
    return folder


@pytest.fixture(scope="session", autouse=True)
def marked_pictures():
    """Pictures are one grey point while this set is empty: the process that renders a structure
    takes 2 s, the plots of a run take 1 s."""
    from matplotlib.figure import Figure
    from PIL import Image

    from beadwave.workflows.stages.pages import pictures

    point, drawing = Image.new("L", (1, 1), 128), set()
    rendered, saved = pictures.child, Figure.savefig

    def child(module, *files, seconds):
        if drawing:
            return rendered(module, *files, seconds=seconds)
        for file in files:
            if file.endswith(".png"):
                point.save(file)
        return CompletedProcess(module, 0)

    def savefig(figure, file, **options):
        if drawing:
            saved(figure, file, **options)
        else:
            point.save(file, "PNG")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "child", child)
        patch.setattr(Figure, "savefig", savefig)
        yield drawing


@pytest.fixture(autouse=True)
def pictures_where_marked(request, marked_pictures):
    """A test that is marked pictures draws them."""
    if request.node.get_closest_marker("pictures"):
        marked_pictures.add(request.node.nodeid)
    yield
    marked_pictures.clear()


@pytest.fixture
def files_read_here(monkeypatch):
    """Files of CAD, meshes and numbers are read by their readers in this process: one of their own
    loads gmsh for 0.7 s. Not for files on which a reader crashes or hangs."""
    from beadwave.workflows.files import foreign, foreign_reader

    def read(module, *arguments, seconds):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", [module, *arguments])
            try:
                foreign_reader.main()
            except SystemExit as refused:
                return CompletedProcess(module, refused.code)
        return CompletedProcess(module, 0)

    for limit in ("end_after_work", "limit_memory"):
        monkeypatch.setattr(foreign_reader, limit, lambda _: None)
    monkeypatch.setattr(foreign, "child", read)


@pytest.fixture
def plain(monkeypatch):
    """Kernels as they are written, as plain Python."""
    from beadwave.dem.kernels.compiled import CompiledFunction

    monkeypatch.setattr(CompiledFunction, "__call__", lambda kernel, *given: kernel.py_func(*given))


@pytest.fixture(params=["plain", pytest.param("compiled", marks=pytest.mark.slow)])
def kernels(request):
    """Kernels as plain Python, and compiled among the slow tests: a short march takes Python 0.1 to
    2 s, and the compiler 3 to 7 s for arguments of other types than those of other tests."""
    if request.param == "plain":
        request.getfixturevalue("plain")
