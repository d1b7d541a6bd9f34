"""A module of ours run in a child process: if it crashes or hangs, this process gets a status.

The child imports nothing from the working directory, ends itself when its time is over or whoever
started it is gone, and dumps no core. What runs in it is
`python -m beadwave.workflows.files.child PARENT SECONDS MODULE ...`.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from os import getpid
from subprocess import DEVNULL, CompletedProcess, Popen, TimeoutExpired, run

from beadwave import system


def child(module: str, *arguments: str, seconds: float) -> CompletedProcess[bytes]:
    """Result of `python -m module arguments`: exit status, stdout and stderr.

    Raises TimeoutError where it took longer. A negative status is the signal that killed it.
    """
    command = _command(seconds, module, *arguments)
    try:
        with system.lifeline() as end:
            limit = seconds + system.GRACE  # a child ends itself where it can
            ended = run(command, capture_output=True, stdin=end, timeout=limit, check=False)
    except TimeoutExpired:
        raise TimeoutError(f"{module} took more than {seconds:g} s") from None
    if system.timed_out(ended.returncode):
        raise TimeoutError(f"{module} took more than {seconds:g} s")
    return ended


@contextmanager
def while_open(module: str, *arguments: str) -> Iterator[Popen]:
    """`python -m module arguments` while the context lasts; what still runs then is killed."""
    with system.lifeline() as end:
        process = Popen(_command(0, module, *arguments), stdin=end, stdout=DEVNULL, stderr=DEVNULL)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def _command(seconds: float, module: str, *arguments: str) -> list[str]:
    return [
        sys.executable, "-P", "-m", "beadwave.workflows.files.child", f"{getpid()}",
        f"{seconds}", module, *arguments,
    ]  # fmt: skip


def main() -> None:
    """Run the module named on the command line for as long as it may."""
    from runpy import run_module

    parent, seconds, module, *arguments = sys.argv[1:]
    system.end_after(float(seconds))
    system.end_with(int(parent))
    system.dump_no_core()
    sys.argv = [module, *arguments]
    run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
