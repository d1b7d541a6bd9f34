"""The folder of a run: files appear complete or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from os import W_OK, access, replace
from pathlib import Path
from typing import NamedTuple

from workflows.scene import InvalidScene

FILES = (
    "summary.json",
    "report.html",
    "trajectory.npz",
    "rom.npz",
    "rom.mat",
    "modes.vtu",
    "figures/velocities.png",
    "figures/energies.png",
    "figures/frequency_response.png",
    "figures/assembly.png",
    "figures/modes.png",
)


class Picture(NamedTuple):
    """A PNG for `figures/`."""

    name: str
    png: bytes


class RunFolder:
    """Writes beside and renames; what an earlier run of another scene left is removed first."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, scene_toml: str, source: Path | None) -> None:
        """Start a run of this scene; raises InvalidScene where the folder cannot take it."""
        try:
            self._begin(scene_toml, source)
        except OSError as error:
            raise InvalidScene(
                f"--out {self.path} cannot be written ({error.strerror}); choose another."
            ) from None

    def _begin(self, scene_toml: str, source: Path | None) -> None:
        target = self.path / "scene.toml"
        old = target.read_bytes().decode(errors="replace") if target.is_file() else None
        if source and old != scene_toml and target.exists() and target.samefile(source):
            raise InvalidScene(
                f"--out {self.path} would overwrite the scene {source}; choose another."
            )
        self.make()
        for folder in (self.path, self.path / "figures"):
            for left in folder.glob(".*.part.*"):
                left.unlink()
        for name in FILES if old != scene_toml else FILES[:2]:
            (self.path / name).unlink(missing_ok=True)
        self.write("scene.toml", scene_toml)

    def make(self) -> None:
        """Make the folder; raises InvalidScene where it cannot be one."""
        try:
            (self.path / "figures").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidScene(
                f"--out {self.path} cannot be a folder ({error.strerror}); choose another."
            ) from None

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """A path to write to, renamed to the file once it is complete."""
        target = self.path / name
        part = target.with_name(f".{target.stem}.part{target.suffix}")
        try:
            yield part
            replace(part, target)
        finally:
            part.unlink(missing_ok=True)

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a whole file."""
        raw = content.encode() if isinstance(content, str) else content
        with self.writing(name) as part:
            part.write_bytes(raw)
        return self.path / name


def checked_file(path: Path, option: str = "--out") -> Path:
    """The path of a file to write, its folder made; raises InvalidScene where it cannot be one."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidScene(
            f"{option} {path} cannot be a file ({error.strerror}); choose another."
        ) from None
    if path.is_dir() or not access(path.parent, W_OK):
        why = "it is a folder" if path.is_dir() else "its folder is read-only"
        raise InvalidScene(f"{option} {path} cannot be written, {why}; choose another.")
    return path


def checked_folder(path: Path) -> Path:
    """The path of a folder to make later; raises InvalidScene where it cannot be one."""
    there = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    if not there.is_dir() or not access(there, W_OK):
        why = "is read-only" if there.is_dir() else "is a file"
        raise InvalidScene(f"--out {path} cannot be a folder ({there} {why}); choose another.")
    return path


def write_pictures(folder: RunFolder, pictures: tuple[Picture, ...]) -> None:
    """Write each picture to `figures/`."""
    for picture in pictures:
        folder.write(f"figures/{picture.name}.png", picture.png)


def write_pictures_to(path: Path, pictures: tuple[Picture, ...]) -> None:
    """Write pictures to a folder of no run; raises InvalidScene where it cannot take them."""
    folder = RunFolder(path)
    folder.make()
    write_pictures(folder, pictures)
