"""A program that is missing, or does not start, is skipped with what installs it."""

from ctypes import CDLL

import pytest

from peer_programs import require_module, require_program


def without_its_library():
    CDLL("libno-such-mpi.so.12")


@pytest.mark.parametrize(
    ("required", "remedy"),
    [
        (lambda: require_program("no-such-program", "its-package"), "apt-get install its-package"),
        (lambda: require_module("no_such_module"), "./install.sh verify"),
    ],
)
def test_a_missing_program_is_skipped_with_what_installs_it(required, remedy):
    with pytest.raises(pytest.skip.Exception, match="is not installed") as skipped:
        required()
    assert remedy in skipped.value.msg


def test_a_module_whose_library_is_missing_is_skipped_and_names_it():
    with pytest.raises(pytest.skip.Exception) as skipped:
        require_module("json", without_its_library)
    assert "does not start (libno-such-mpi.so.12" in skipped.value.msg
    assert "./install.sh verify" in skipped.value.msg


def test_a_program_that_the_system_cannot_load_is_skipped(monkeypatch, tmp_path):
    """The loader ends with status 127 and names the library."""
    broken = tmp_path / "ccx"
    broken.write_text("#!/bin/sh\necho 'ccx: libspooles.so: not found' >&2\nexit 127\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(pytest.skip.Exception) as skipped:
        require_program("ccx", "calculix-ccx")
    assert "libspooles" in skipped.value.msg
    assert "apt-get install --reinstall calculix-ccx" in skipped.value.msg
