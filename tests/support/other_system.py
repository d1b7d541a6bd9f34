"""Windows, as far as the modules of beadwave can tell: what POSIX alone has is hidden from them.

`prepare` makes the environment of processes in which `hide` runs before anything else, in those
that beadwave starts too. Libraries, Python's own among them, see everything, as they need it here.
Nobody forks by `os.fork` or makes a symbolic link, and below the folders that are watched files
have names that Windows takes and are neither replaced nor removed while this process has them open.
"""

import builtins
import os
import re
import sys
import warnings
from importlib.machinery import PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType

MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix", "syslog"}
HIDDEN = {  # of modules that are there
    "os": r"(fork|kill|(get|set)(p|s|re|res)?[ug]id|sched_|wait|mkf|mkn|posix_|W[A-Z]).*"
          r"|O_(NOFOLLOW|CLOEXEC|DIRECTORY|NONBLOCK|DSYNC|SYNC)|(get|set)(e[ug]id|p?gid|pgrp|sid)"
          r"|symlink|register_at_fork|uname|nice|l?chown|fchown|fchmod|statvfs|pread"
          r"|pwrite|sysconf|getloadavg|getpgid|ctermid|pipe2",
    "signal": r"SIG(HUP|ALRM|QUIT|PROF|KILL|USR1|USR2|CHLD|PIPE|XCPU|STOP|TSTP|CONT|VTALRM)"
              r"|SIG_(BLOCK|UNBLOCK|SETMASK)|.*itimer|ITIMER_.*|alarm|pause|pthread_.*|sigwait.*"
              r"|siginterrupt|sigpending",
}  # fmt: skip
SAID = {"os": {"name": "nt"}}
PASSED_THROUGH = {"pathlib", "io", "os", "codecs", "genericpath", "posixpath", "shutil", "tempfile"}
RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.I)
WATCHED = "OTHER_SYSTEM_WATCHED"


def prepare(folder: Path, *watched: Path) -> dict[str, str]:
    """Environment of Python processes that are such a system; `folder` takes their start-up."""
    folder.mkdir(exist_ok=True)
    (folder / "sitecustomize.py").write_text("import other_system\n\nother_system.hide()\n")
    support = Path(__file__).parent
    paths = (folder, support, support.parents[1] / "src")
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(map(str, paths)),
        "PYTHONWARNDEFAULTENCODING": "1",
        "PYTHONWARNINGS": "ignore",  # the command keeps the filters that it finds
        WATCHED: os.pathsep.join(map(str, watched)),
    }


class Part(ModuleType):
    """A module without what is hidden of it."""

    def __getattr__(self, name):
        module = self.__name__
        if re.fullmatch(HIDDEN[module], name):
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        return SAID.get(module, {}).get(name) or getattr(sys.modules[module], name)


PARTS = {name: Part(name) for name in HIDDEN}


def importing(name, globals=None, locals=None, fromlist=(), level=0):
    """`__import__` of the modules of beadwave."""
    if level == 0 and name in MODULES:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    if level == 0 and name in PARTS:
        return PARTS[name]
    return builtins.__import__(name, globals, locals, fromlist, level)


BUILTINS = vars(builtins) | {"__import__": importing}


class Loader(SourceFileLoader):
    """Runs a module with builtins of its own."""

    def exec_module(self, module):
        module.__dict__["__builtins__"] = BUILTINS
        super().exec_module(module)


class Finder:
    """Finds the modules of beadwave."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] != "beadwave":
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = Loader(spec.loader.name, spec.loader.path)
        return spec


def hide() -> None:
    """Hide it in this process, before beadwave is imported."""
    import multiprocessing
    import runpy

    multiprocessing.set_start_method("spawn")
    sys.meta_path.insert(0, Finder)
    # `python -m` runs a module without a loader
    sys.modules["__main__"].__dict__["__builtins__"] = BUILTINS
    run_code = runpy._run_code

    def run(code, run_globals, *given):
        run_globals["__builtins__"] = BUILTINS
        return run_code(code, run_globals, *given)

    runpy._run_code = run
    warnings.filterwarnings("error", category=EncodingWarning, module=r"beadwave(\.|$)")
    watched = tuple(filter(None, os.environ[WATCHED].split(os.pathsep)))
    sys.addaudithook(Rules(watched))


class Rules:
    """Hook that raises where Windows would."""

    def __init__(self, watched: tuple[str, ...]) -> None:
        self.watched, self.busy = watched, False

    def __call__(self, event, given):
        if event in ("os.fork", "os.forkpty"):
            raise OSError(f"{event} is not there")
        if event == "os.symlink":
            raise OSError(1314, "a required privilege is not held by the client", given[1])
        if self.busy or event not in ("open", "os.mkdir", "os.rename", "os.remove"):
            return
        self.busy = True
        try:
            self.look(event, given)
        finally:
            self.busy = False

    def look(self, event, given):
        paths = [os.path.abspath(os.fsdecode(p)) for p in given[: 1 + (event == "os.rename")]
                 if isinstance(p, str | bytes | os.PathLike)]  # fmt: skip
        if event == "open":
            if paths and paths[0].startswith(("/proc", "/sys/")) and called_by_us():
                raise FileNotFoundError(2, "hidden", paths[0])
            if not given[2] & os.O_CREAT:
                return
        inside = [(w, p) for p in paths for w in self.watched if p.startswith(w + os.sep)]
        if event in ("os.rename", "os.remove"):
            for _, path in inside:
                if path in opened():
                    raise PermissionError(13, "another handle has it open", path)
        if event != "os.remove":
            for folder, path in inside:
                for part in Path(path).relative_to(folder).parts:
                    if re.search(r'[<>:"|?*\\\x00-\x1f]|[. ]$', part) or RESERVED.fullmatch(part):
                        raise OSError(22, "no name of a file", path)


def called_by_us() -> bool:
    """True if a module of beadwave calls, through the libraries of files."""
    frame = sys._getframe(3)
    while frame is not None:
        name = frame.f_globals.get("__name__", "")
        if name == "__main__" and frame.f_globals.get("__spec__"):
            name = frame.f_globals["__spec__"].name
        root = name.partition(".")[0]
        if root not in PASSED_THROUGH:
            return root == "beadwave"
        frame = frame.f_back
    return False


def opened() -> set[str]:
    """Files that this process has open or mapped."""
    paths = set()
    for descriptor in os.listdir("/proc/self/fd"):
        try:
            paths.add(os.readlink(f"/proc/self/fd/{descriptor}"))
        except OSError:
            continue
    with open("/proc/self/maps", encoding="utf-8", errors="surrogateescape") as lines:
        paths |= {line.split(maxsplit=5)[-1].rstrip("\n") for line in lines}
    return paths
