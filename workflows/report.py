"""`report.html`: a run folder as one page that needs no other file."""

from base64 import b64encode
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment
from pydantic import ValidationError

from workflows.run_folder import RunFolder
from workflows.scene import InvalidScene
from workflows.summary import HAMMER_TEST_HZ, Summary, rows

CAPTIONS = {
    "velocities": "Velocities of the observed spheres. Positive is towards the wall: first the "
    "incident wave (i), then the waves that the wall sends back, by number.",
    "waves": "The chain over time: each line of spheres' collisions is a wave, i towards the wall, "
    "numbers those sent back. The scale is linear near zero and logarithmic beyond.",
    "energies": "Where the energy is, and how well the ledger closes.",
    "frequency_response": "Displacement at the contact per force there: what the chain feels.",
    "assembly": "The meshed assembly, a colour per body; the chain hits the face on the right.",
    "modes": "The four modes of the hammer test, paired by shape, beside the undeformed outline. "
    "Bright moves, dark rests; displacements are exaggerated.",
}


def write_report(folder: Path) -> Path:
    """Write the page from what the folder holds; raises InvalidScene without a summary."""
    summary = _summary(folder)
    page = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
        (files("workflows") / "report.html.jinja").read_text(encoding="utf-8")
    )
    scene = folder / "scene.toml"
    html = page.render(
        summary=summary,
        rows=rows(summary),
        hammer_test_hz=HAMMER_TEST_HZ,
        pictures=_pictures(folder),
        scene=scene.read_text(encoding="utf-8") if scene.is_file() else "",
    )
    return RunFolder(folder).write("report.html", html)


def _summary(folder: Path) -> Summary:
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
