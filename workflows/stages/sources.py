"""Which source files of beadwave a module depends on: its own, and those of all modules of ours
that it imports, directly or not.

They are read from the text, without importing anything: modules named in import statements, inside
functions too, or in a string by themselves (what a child process runs), and data files beside the
module that it names.
"""

import re
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

OURS = r"beadwave(?:\.\w+)*"
FROM = re.compile(rf"^[ \t]*from[ \t]+({OURS})[ \t]+import[ \t]+(\([^)]*\)|[^\n]+)", re.MULTILINE)
IMPORT = re.compile(r"^[ \t]*import[ \t]+([^\n]+)", re.MULTILINE)
NAMED = re.compile(rf'"({OURS})"')
DATA = re.compile(r'"([\w.-]+\.(?:toml|json|csv))"')


@cache
def fingerprint(*roots: str) -> str:
    """SHA-256, in hexadecimal digits, of every source and data file that these modules
    depend on."""
    content = sha256()
    for name in sorted(modules(*roots)):
        content.update(digest(name))
    return content.hexdigest()


@cache
def digest(module: str) -> bytes:
    """SHA-256 of a module's source and data files, read once for all that depend on it."""
    content = sha256()
    for path in files(module):
        content.update(f"{module} {path.name}\n".encode() + path.read_bytes())
    return content.digest()


def modules(*roots: str) -> set[str]:
    """These modules and all modules of ours that they import, directly or not."""
    reached: set[str] = set()
    to_read = [*roots]
    while to_read:
        name = to_read.pop()
        if name not in reached:
            reached.add(name)
            to_read += imported(name)
    return reached


@cache
def imported(module: str) -> frozenset[str]:
    """Modules of ours that a module imports itself; a package stands for its `__init__`."""
    text = _origin(module).read_text(encoding="utf-8")
    names = [name for line in IMPORT.findall(text) for name in _words(line)]
    for package, words in FROM.findall(text):
        names += [package, *(f"{package}.{word}" for word in _words(words))]
    return frozenset(name for name in [*names, *NAMED.findall(text)] if _origin(name))


def files(module: str) -> list[Path]:
    """The module's source and the data files beside it that it names."""
    source = _origin(module)
    named = DATA.findall(source.read_text(encoding="utf-8"))
    return [source, *(path for name in named if (path := source.parent / name).is_file())]


def _words(names: str) -> list[str]:
    words = (word.split() for word in names.strip("()").split(","))
    return [word[0] for word in words if word]


@cache
def _origin(name: str) -> Path | None:
    """The file of a module of ours; None for anything else, a function in one for instance, and for
    `beadwave` itself, which names every public function and computes nothing."""
    package, *below = name.split(".")
    if package != "beadwave" or not below:
        return None
    # find_spec imports what is above a module; `beadwave` alone has nothing above it
    path = Path(find_spec(package).origin).parent.joinpath(*below)
    candidates = (path.with_name(f"{path.name}.py"), path / "__init__.py")
    return next((file for file in candidates if file.is_file()), None)
