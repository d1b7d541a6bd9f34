"""Differences between systems: locks, memory, processor time, signals, limits of children, file
names.

No other module asks for what one system alone has (`tests/test_architecture.py`). Each function
says what holds where the system lacks it.
"""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import ENOLCK, ENOSYS, ENOTSUP
from pathlib import Path
from threading import Event, Thread, Timer

try:
    import resource
except ImportError:  # Windows
    resource = None

WINDOWS = os.name == "nt"
LINUX = hasattr(os, "uname") and os.uname().sysname == "Linux"

# signals, None where there is none
HANGUP = getattr(signal, "SIGHUP", None)  # the terminal is closed
QUIT = getattr(signal, "SIGQUIT", None)
BREAK = getattr(signal, "SIGBREAK", None)  # Ctrl-Break, and the console is closed, on Windows
ALARM = getattr(signal, "SIGALRM", None)
PROFILE = getattr(signal, "SIGPROF", None)
REPEATS = signal.SIGINT if ALARM is None else ALARM  # its handler is called again by `repeat`


def existing(*numbers: int | None) -> tuple[int, ...]:
    """Those of the signals that this system has, each once."""
    return tuple(dict.fromkeys(number for number in numbers if number is not None))


# ---- signals and timers ------------------------------------------------------------------------

_repeats_ended = Event()


def repeat(handler: Callable, seconds: float) -> None:
    """Call the handler in the main thread every `seconds` as the one of REPEATS: by a timer, or by
    a thread where there are none."""
    signal.signal(REPEATS, handler)
    if ALARM is not None:
        signal.setitimer(signal.ITIMER_REAL, seconds, seconds)
        return

    def again() -> None:
        while not _repeats_ended.wait(seconds):
            signal.raise_signal(REPEATS)  # its handler runs in the main thread

    Thread(target=again, daemon=True).start()


def end_repeats() -> None:
    """End what `repeat` began."""
    _repeats_ended.set()
    if ALARM is not None:
        signal.setitimer(signal.ITIMER_REAL, 0)


def woken_by_signals() -> int:
    """Descriptor from which a thread reads a byte for each signal as it comes, also while the main
    thread is in compiled code; a forked process has none."""
    reading, writing = os.pipe()
    if hasattr(os, "set_blocking"):  # on Windows from Python 3.12, and not needed there
        os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))
    return reading


# ---- children ----------------------------------------------------------------------------------

# seconds that a parent waits longer than its child's own timer
GRACE = 0.0 if ALARM is None else 5.0


@contextmanager
def lifeline() -> Iterator[int]:
    """Standard input of a child that calls `end_with` this process: the end of a pipe that is
    closed however this process ends."""
    if WINDOWS:
        from subprocess import DEVNULL

        yield DEVNULL
        return
    read_end, write_end = os.pipe()
    try:
        yield read_end
    finally:
        os.close(read_end)
        os.close(write_end)


def end_with(parent: int) -> None:
    """From now on this process ends with the one that opened its `lifeline`."""

    def wait() -> None:
        if WINDOWS:
            # no thread may wait for a byte of standard input: the libraries of numpy ask for its
            # kind when they are loaded, and the answer comes after that byte
            import psutil

            with suppress(psutil.NoSuchProcess):
                psutil.Process(parent).wait()
        else:
            os.read(0, 1)
        os._exit(1)

    Thread(target=wait, daemon=True).start()


def end_after(seconds: float) -> None:
    """End this process after some time, 0 never; without timers its parent does."""
    if ALARM is not None:
        signal.setitimer(signal.ITIMER_REAL, seconds)


def end_after_work(seconds: float) -> None:
    """End this process after some time of the processor; without timers its parent does, by the
    clock."""
    if PROFILE is not None:
        signal.setitimer(signal.ITIMER_PROF, seconds)


def timed_out(status: int) -> bool:
    """True if `end_after` ended a process of this status."""
    return ALARM is not None and status == -ALARM


def worked_out(status: int) -> bool:
    """True if `end_after_work` ended a process of this status."""
    return PROFILE is not None and status == -PROFILE


def crash(status: int) -> str | None:
    """The signal, or Windows' number of the exception, that ended a process of this status."""
    if status < 0:
        return signal.Signals(-status).name
    return f"{status:#x}" if status >= 0xC0000000 else None


def dump_no_core() -> None:
    """A crash of this process leaves no file; on Windows none does."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def limit_memory(size: float) -> None:
    """Bytes of data that this process may hold, after which it gets a MemoryError; where the system
    has no such limit, or allows less, it stays."""
    if resource is not None and size < float("inf"):
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_DATA, (int(size), int(size)))


def runs(process: int) -> bool:
    """True if another process of this number runs."""
    # os.kill(process, 0), as elsewhere, would send a Ctrl-C on Windows
    import psutil

    try:
        return process != os.getpid() and psutil.pid_exists(process)
    except OverflowError:
        return False


# ---- memory and processors ---------------------------------------------------------------------

GROUPS = Path("/sys/fs/cgroup")
NAMES = {  # files of a group's limit and use, and the key of cached files in its memory.stat
    "": ("memory.max", "memory.current", "inactive_file"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}


def free_memory() -> float:
    """Bytes that this process can still take: of the machine, of its control group, of its limits;
    inf where the system does not say.

    A container's limit is in its control group and in no figure of the machine; memory that the
    group uses for cached files is given back on demand.
    """
    import psutil

    free = [*_of_groups(), *_of_limits()]
    with suppress(OSError, psutil.Error):
        free.append(float(psutil.virtual_memory().available))
    return max(0.0, min(free, default=float("inf")))


def _of_groups(groups: Path = GROUPS, mine: Path = Path("/proc/self/cgroup")) -> Iterator[float]:
    """Bytes left in the process's control group and in those above it, of version 1 or 2: limit
    less use, and the cached files that the system gives back on demand."""
    for line in _text(mine).splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers not in NAMES:
            continue
        limit_file, used_file, cached = NAMES[controllers]
        root = groups / controllers
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            if not folder.is_relative_to(root):
                continue
            limit, used = _text(folder / limit_file).strip(), _text(folder / used_file).strip()
            if limit.isdigit() and used.isdigit():  # "max" stands for no limit
                stat = dict(line.split() for line in _text(folder / "memory.stat").splitlines())
                yield float(limit) - float(used) + float(stat.get(cached, 0))


def _of_limits() -> Iterator[float]:
    """Bytes up to the limit of this process' addresses; none without a limit."""
    if resource is None:
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        import psutil

        yield limit - float(psutil.Process().memory_info().vms)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


def reset_peak_memory() -> None:
    """Let `peak_memory` of this process begin anew, where the system allows it."""
    with suppress(OSError):  # 5 stands for the peak of the resident set
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8", newline="\n")


def peak_memory(process: int | None = None) -> float | None:
    """Largest resident set [bytes] of this or another process, since its peak was reset on Linux,
    since its start on Windows; None where the system does not tell, or there is no such process."""
    lines = _text(Path("/proc", str(process or "self"), "status")).splitlines()
    kilobytes = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    if kilobytes:
        return 1024.0 * kilobytes[0]
    import psutil

    try:
        return float(psutil.Process(process).memory_info().peak_wset)
    except (AttributeError, psutil.Error):
        return None


def largest_child() -> float | None:
    """Largest resident set [bytes] of the children that have ended; None where the system does not
    tell."""
    if resource is None:
        return None
    unit = 1.0 if os.uname().sysname == "Darwin" else 1024.0
    return unit * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss


def children_seconds() -> float:
    """Processor seconds of the children that have ended; 0 where the system does not tell."""
    if resource is None:
        return 0.0
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def free_cores() -> int:
    """Processors that this process may use; all of the machine where the system does not tell."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def processor_name() -> str:
    """The processor's model where the system tells it, else its kind."""
    import platform

    lines = _text(Path("/proc/cpuinfo")).splitlines()
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return next(iter(models), platform.processor() or platform.machine())


# ---- what can be installed ---------------------------------------------------------------------


def adding(extra: str) -> str:
    """The command that adds an extra: of a checkout on Linux, else of pip."""
    is_checkout = Path(__file__).parents[2].joinpath("install.sh").is_file()
    by_script = LINUX and is_checkout
    return f"./install.sh {extra}" if by_script else f'pip install "beadwave[{extra}]"'


def providing(package: str) -> str:
    """Command that installs a program of a Debian package."""
    return f"apt-get install {package}" if LINUX else "the installer of its makers"


# ---- files -------------------------------------------------------------------------------------

# folders that the system or its users share
SHARED = (
    "/", "/bin", "/boot", "/dev", "/etc", "/home", "/lib", "/lib32", "/lib64", "/opt", "/proc",
    "/run", "/sbin", "/sys", "/usr", "/usr/bin", "/usr/lib", "/usr/local", "/usr/sbin",
    "/usr/share", "/var", "/Applications", "/Library", "/System", "/Users", "/Volumes", "/private",
)  # fmt: skip
SHARED_ON_WINDOWS = ("SystemRoot", "ProgramFiles", "ProgramFiles(x86)", "ProgramData", "PUBLIC")
NO_LOCKS = (ENOLCK, ENOSYS, ENOTSUP)  # file systems without locks
RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.I)  # devices of Windows
LONGEST = 100  # letters: with a folder of 150 below the 260 of a path on Windows


def is_shared(folder: Path) -> bool:
    """True if the system or its users share a resolved folder; a run folder may lie in one but not
    be one."""
    root = Path(folder.anchor)
    named = {Path(os.environ[name]) for name in SHARED_ON_WINDOWS if name in os.environ}
    return folder in {root, root / "Users", *map(Path, SHARED), *named}


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """A block during which no other process has the lock that a file stands for; raises
    BlockingIOError where one has it. The file is made, is empty, and goes with the lock.

    The system drops the lock with the process; a file system without locks gives none.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path, timeout=0, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise BlockingIOError(f"{path} is locked") from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
    try:
        yield
    finally:
        # while it is held, so that who has opened it before finds out that it is gone; on Windows
        # an open file cannot be removed
        if WINDOWS:
            lock.release()
        with suppress(OSError):
            path.unlink()
        lock.release()


def held_open(path: Path) -> bool:
    """True if another program has the file open so that it cannot be replaced, as on Windows."""
    if not WINDOWS:
        return False
    try:
        os.replace(path, path)
    except FileNotFoundError:
        return False
    except PermissionError:
        return True
    return False


def untrusted(folder: Path) -> str | None:
    """Reason for which somebody else may write into a folder; None where the user alone may, and on
    Windows, whose folders of users are closed to others by inherited rights."""
    if not hasattr(os, "geteuid"):
        return None
    status = folder.stat()
    if status.st_uid != os.geteuid():
        return f"{folder} belongs to another user"
    if status.st_mode & 0o022:  # of group and others
        return f"others may write into {folder} (chmod go-w ends that)"
    return None


def link_or_copy(source: Path, target: Path) -> None:
    """Another name for a file; a copy where links are not allowed, as on Windows without Developer
    Mode."""
    try:
        target.symlink_to(source.absolute())
    except (OSError, NotImplementedError):
        from shutil import copyfile

        copyfile(source, target)


def too_long(path: str) -> bool:
    """True if the path has 260 letters or more, which Windows does not accept by default: such a
    file is treated as missing."""
    return WINDOWS and len(os.path.abspath(path)) >= 260


def file_name(name: str) -> str:
    """The name of a file or folder by a user's words, legal on every system; most names are their
    own.

    Windows takes none of <>:"/\\|?*, no control characters, no dot or blank at the end and no name
    of a device with any ending.
    """
    legal = re.sub(r'[<>:"/\\|?*\x00-\x1f]', "-", name)
    if len(legal) > LONGEST:
        stem, dot, ending = legal.rpartition(".") if "." in legal[-8:] else (legal, "", "")
        legal = stem[: LONGEST - len(dot + ending)] + dot + ending
    legal = legal.rstrip(". ")
    return f"_{legal}" if not legal or RESERVED.fullmatch(legal) else legal


# set where the process is the command line's, which may end it; from Python it is its caller's
ended_by_us = Event()


@contextmanager
def ended_after(seconds: float, sentence: str) -> Iterator[None]:
    """End a process of the command line with a sentence and status 2 where the block takes longer:
    a compiled library inside it cannot be stopped otherwise. What is half written stays under
    another name. A process that is not ours goes on."""
    if not ended_by_us.is_set():
        yield
        return
    timer = Timer(seconds, _end, (sentence,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _end(sentence: str) -> None:
    os.write(2, f"beadwave: {sentence}\n".encode())
    os._exit(2)
