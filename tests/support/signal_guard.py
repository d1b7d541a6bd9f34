"""Signals in tests: none reaches pytest from a test, none is handled otherwise after a test.

A pytest plugin that `conftest.py` loads. A test that signalled the process group of pytest, or left
a handler or a timer behind, would end the whole run amid its dots, without a summary.
"""

import faulthandler
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

# whose default ends the process; faults of the processor are those of pytest's own faulthandler
ENDING = (
    signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGALRM, signal.SIGTERM,
    signal.SIGPROF, signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU,
)  # fmt: skip
PYTEST = os.getpid()
kill, killpg = os.kill, os.killpg  # of the system


class Dispositions(NamedTuple):
    """Actions of signals, and the timers that send one."""

    handlers: dict[signal.Signals, object]  # as Python knows them
    kernel: dict[signal.Signals, str]  # "default", "ignored" or "caught": a library in C sets it
    timers: dict[int, float]  # s until the first signal, 0 where none comes


def dispositions() -> Dispositions:
    """Those of this process now."""
    status = Path("/proc/self/status").read_text()
    words = dict(line.split(":", 1) for line in status.splitlines())
    ignored, caught = (int(words[name], 16) for name in ("SigIgn", "SigCgt"))

    def kernel(number: int) -> str:
        bit = 1 << (number - 1)
        return "ignored" if ignored & bit else "caught" if caught & bit else "default"

    return Dispositions(
        {number: signal.getsignal(number) for number in ENDING},
        {number: kernel(number) for number in ENDING},
        {timer: signal.getitimer(timer)[0] for timer in (signal.ITIMER_REAL, signal.ITIMER_PROF)},
    )


def restore(before: Dispositions) -> list[str]:
    """Handlers and timers as they were before; a clause for each that was not."""
    now, messages = dispositions(), []
    for timer, seconds in now.timers.items():
        if seconds and not before.timers[timer]:
            signal.setitimer(timer, 0.0)
            messages.append(f"a timer sends a signal in {seconds:.3g} s")
    for number, handler in before.handlers.items():
        if now.handlers[number] != handler or now.kernel[number] != before.kernel[number]:
            if handler is not None:  # None: set by C, which Python cannot set again
                signal.signal(number, handler)
            left = f"{now.handlers[number]} ({now.kernel[number]})"
            earlier = f"{handler} ({before.kernel[number]})"
            messages.append(f"{number.name} is left to {left}, before it was {earlier}")
    return messages


@contextmanager
def signals_restored() -> Iterator[None]:
    """A block with a library that does not give back the handlers that it replaced."""
    before = dispositions()
    try:
        yield
    finally:
        restore(before)


@pytest.fixture(autouse=True)
def signals_as_before() -> Iterator[None]:
    """After each test signals and timers are those of before; else the test fails."""
    before = dispositions()
    yield
    if messages := restore(before):
        pytest.fail(f"signals are not as before the test: {'; '.join(messages)}", pytrace=False)


def _descends(pid: int) -> bool:
    """True of a process that was started by pytest, by its children or theirs."""
    while pid > 1:
        # the name in brackets may hold spaces and brackets of its own
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        if pid == PYTEST:
            return True
    return False


def _refusal(pid: int) -> str | None:
    """Reason why a test must not signal this process, or group where it is negative."""
    group = os.getpgid(PYTEST)
    if pid in (0, -1, -group):
        return "is the process group of pytest, or everything"
    if abs(pid) == PYTEST:
        return "is pytest"
    try:
        descends = _descends(abs(pid))
    except FileNotFoundError:
        return None  # no such process: the system says so
    return None if descends else "was not started by a test"


def _kill(pid: int, number: int) -> None:
    if number and (reason := _refusal(pid)):  # 0 asks whether the process lives
        pytest.fail(
            f"signal {number} to {pid}, which {reason}: start a child with "
            "subprocess and start_new_session=True, and signal that."
        )
    kill(pid, number)


def _killpg(group: int, number: int) -> None:
    _kill(-group, number)


def pytest_configure(config: pytest.Config) -> None:
    """Guard os.kill, which subprocess, multiprocessing and psutil call, and os.killpg; a signal
    that ends pytest all the same says so, with the place where every thread was."""
    os.kill, os.killpg = _kill, _killpg
    stderr = os.dup(2)  # that of the terminal or the log: a test's own is captured

    def trace_and_end(number: int, frame) -> None:
        if os.getpid() == PYTEST:
            name = signal.Signals(number).name
            during = os.environ.get("PYTEST_CURRENT_TEST", "no test")
            os.write(stderr, f"\npytest is ended by {name} during {during}\n".encode())
            faulthandler.dump_traceback(stderr)
        signal.signal(number, signal.SIG_DFL)
        kill(os.getpid(), number)

    for number in ENDING:
        # what the caller of pytest has ignored, as nohup does, stays so
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, trace_and_end)
    # started in the background, pytest inherits an ignored Ctrl-C, and so would what tests start
    signal.signal(signal.SIGINT, signal.default_int_handler)
