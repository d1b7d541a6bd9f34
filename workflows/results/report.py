"""`report.html`: a run folder as one page that needs no other file."""

from base64 import b64encode
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment
from pydantic import ValidationError

from workflows.files.run_folder import RunFolder
from workflows.results.summary import Summary, rows
from workflows.scene import InvalidScene
from workflows.thesis import HAMMER_TEST_HZ

CAPTIONS = {
    "velocities": "Velocities of the observed spheres, positive towards the wall. Marked are the "
    "incident wave (i) and the reflected ones, by number.",
    "waves": "Velocities of all spheres over time. A dashed line is a wave: i incident, numbers "
    "reflected. The scale is linear near zero and logarithmic beyond.",
    "energies": "Energies of chain, contacts and wall, and the error of their balance.",
    "frequency_response": "Receptance at the contact, displacement per force: the reduced "
    "model, and direct solutions of the full one.",
    "assembly": "The meshed assembly, a colour per body.",
    "modes": "The measured modes, paired by shape, or the lowest ones where there are no targets, "
    "beside the undeformed outline. "
    "Colours: displacement, dark is zero; shapes are exaggerated.",
}


def write_report(folder: RunFolder) -> Path:
    """Write the page from what the folder holds; raises InvalidScene without a summary."""
    summary = require_summary(folder.path)
    page = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
        (files("workflows.results") / "report.html.jinja").read_text(encoding="utf-8")
    )
    scene = folder.path / "scene.toml"
    html = page.render(
        summary=summary,
        rows=rows(summary),
        hammer_test_hz=HAMMER_TEST_HZ,
        pictures=_pictures(folder.path),
        scene=scene.read_text(encoding="utf-8") if scene.is_file() else "",
    )
    return folder.write("report.html", html)


def require_summary(folder: Path) -> Summary:
    """The summary of a run folder; raises InvalidScene where there is none."""
    path = folder / "summary.json"
    try:
        return Summary.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError:
        raise InvalidScene(
            f"{folder} is no finished run folder: {path.name} is missing; run the scene first."
        ) from None
    except (ValidationError, UnicodeDecodeError):
        raise InvalidScene(
            f"{path} is not a summary of this program; run the scene again."
        ) from None


def _pictures(folder: Path) -> list[tuple[str, str]]:
    """Caption and base64 of each figure that is there."""
    paths = ((words, folder / "figures" / f"{name}.png") for name, words in CAPTIONS.items())
    return [
        (words, b64encode(path.read_bytes()).decode()) for words, path in paths if path.is_file()
    ]
