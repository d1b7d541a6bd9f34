"""Programs that tests compare with: a missing one skips the test and says what installs it."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from shutil import which
from subprocess import run

import pytest

from beadwave.system import adding, providing

NOT_STARTED = (126, 127)  # statuses of a program that the system cannot load


def require_module(name: str, start: Callable[[], object] | None = None) -> None:
    """Skip if a module of the extra `verify` is not installed, or if `start` (None: its import)
    does not find a library that the module needs."""
    if find_spec(name) is None:
        pytest.skip(f"{name} is not installed; {adding('verify')} adds it.")
    try:
        (start or partial(import_module, name))()
    except (ImportError, OSError) as error:
        why = str(error).strip().partition("\n")[0]
        remedy = f"{adding('verify')} adds what it needs."
        pytest.skip(f"{name} is installed and does not start ({why}); {remedy}")


def require_program(name: str, package: str) -> None:
    """Skip if a program is not on the path or does not start; `package` is Debian's."""
    if which(name) is None:
        pytest.skip(f"{name} is not installed; {providing(package)} adds it.")
    version = run(
        [name, "-v"], capture_output=True, encoding="utf-8", errors="replace", check=False
    )
    if version.returncode in NOT_STARTED:
        why = version.stderr.strip().partition("\n")[0]
        remedy = f"{providing(f'--reinstall {package}')} repairs it."
        pytest.skip(f"{name} is installed and does not start ({why}); {remedy}")
