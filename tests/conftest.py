"""Before anything loads BLAS: its threads fight over the small blocks of sparse factors."""

from os import environ

import pytest

environ.setdefault("OPENBLAS_NUM_THREADS", "1")
pytest_plugins = ["signal_guard"]


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache of results that the tests of a file share."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def shared_cache(cache, tmp_path, monkeypatch):
    """The commands of a test keep their results there, and work in a folder of their own."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(cache))
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def plain(monkeypatch):
    """Kernels as they are written, as plain Python."""
    from dem.kernels.compiled import Compiled

    monkeypatch.setattr(Compiled, "__call__", lambda kernel, *given: kernel.py_func(*given))
