"""`report.html`: a run folder as one page that needs no other file and no network.

Names and words of a scene are escaped by the template; data stand in a block that no browser runs,
without a "<" in it; scripts and styles are allowed by their digests alone.
"""

import json
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

from markupsafe import Markup
from pydantic import ValidationError

from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.report import bundle, page_rows
from beadwave.workflows.report.number_format import (
    difference,
    figures,
    grouped,
    percent,
    share_percent,
    si,
)
from beadwave.workflows.report.page_data import page_data
from beadwave.workflows.report.stage_words import stage_words
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import unfit

CAPTIONS = {
    "velocities": "Velocities of the observed spheres, positive towards the wall; i marks the "
    "incident wave, numbers the reflected ones.",
    "forces": "Force of each chain on the structure over time.",
    "signals": "What the sensors record; i marks the incident wave, numbers the reflected ones.",
    "waves": "Velocity of every sphere over time, linear near zero and logarithmic beyond. Dashed: "
    "the waves that were followed; i incident, numbers reflected.",
    "crystal": "When the wave reaches each sphere, and the largest speed there, over the places at "
    "rest. Grey: nothing arrives. In space: the spheres in the plane of the struck ones' middle.",
    "snapshots": "Speed of the spheres at four instants, over the places at rest.",
    "rows": "Mean velocity of each row along the axis of the impact over time, linear near zero "
    "and logarithmic beyond; of a network and a Y each sphere's speed. Below: kinetic energy.",
    "energies": "Energies of chain, contacts and wall since the start, and the error of their "
    "balance.",
    "friction": "Friction at the wall: over the displacement of the sphere's surface, over time "
    "with its bound, and the share of the contact's area that sticks.",
    "frequency_response": "Receptance at the contact: the reduced model, the finer one that its "
    "error is stated against, and solutions of the full one.",
    "assembly": "The meshed structure, a colour per body, and the arrow of the impact.",
    "modes": "The measured modes, paired by shape, or the lowest ones where there are no targets. "
    "Grey: the outline at rest. Colours: displacement over its largest. Shapes are exaggerated: "
    "bodies part where the springs of a joint give way, and may seem to pass through each other.",
    "contact": "Faces under bolts, facet by facet: pressure of the preload, and where they stick, "
    "slide or are apart.",
    "mesh-error": "Where the error of the mesh arises: energy that each element misses per volume, "
    "in that mode, or static response, in which it is largest, over the largest of all elements.",
}


def write_report(folder: RunFolder, data: dict[str, Any] | None = None) -> Path:
    """Write the page from what the folder holds; raises InvalidScene without a summary. `data` of
    its scripts are read from the folder unless they are there already."""
    return folder.write("report.html", page(folder.path, require_summary(folder.path), data))


def page(folder: Path, summary: Summary, data: dict[str, Any] | None = None) -> str:
    """The page of a run folder: `page/page.html.jinja` filled in, `first_screen.py` says what comes
    first."""
    from PIL import Image  # only who writes a page pays

    try:
        scene = load(str(folder / "scene.toml"))
    except InvalidScene:  # it, or a file that it names, is gone
        scene = None
    scene_toml = folder / "scene.toml"
    data = page_data(folder, summary) if data is None else data

    # pictures in few colours, in the page itself
    pictures = {}
    for name in CAPTIONS:
        path = folder / "figures" / f"{name}.png"
        if path.is_file():
            raw = BytesIO()
            with Image.open(path) as picture:
                few = picture.convert("RGB").quantize(128, Image.Quantize.FASTOCTREE)
            few.save(raw, "PNG")
            pictures[name] = b64encode(raw.getvalue()).decode()

    return in_one_file(
        "page",
        scripts=["vendor/ogl.min.js", "vendor/uplot.min.js"],
        module="main",
        styles=["vendor/uplot.min.css", "style.css"],
        summary=summary,
        scene=scene,
        scene_toml=scene_toml.read_text(encoding="utf-8") if scene_toml.is_file() else "",
        pictures=pictures,
        captions=CAPTIONS,
        data=Markup(harmless_json(data)),
        **page_rows.context(scene, summary, data),
    )


def in_one_file(
    template: str, *, scripts: list[str], module: str, styles: list[str], **context: Any
) -> str:
    """The page of `page/TEMPLATE.html.jinja`, which opens without a network: scripts, a module with
    all that it imports and styles stand in it, with the digests by which its policy allows them.
    """
    from jinja2 import Environment  # only who writes a page pays

    script_texts = [*map(bundle.text, scripts), bundle.bundled(module)]
    style_texts = [*map(bundle.text, styles)]
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    texts: tuple[Callable, ...] = (
        si, percent, difference, figures, grouped, share_percent, stage_words,
    )  # fmt: skip
    environment.filters |= {filter.__name__: filter for filter in texts}
    return environment.from_string(bundle.text(f"{template}.html.jinja")).render(
        scripts=[*map(Markup, script_texts)],
        styles=[*map(Markup, style_texts)],
        script_hashes=Markup("".join(map(_digest, script_texts))),
        style_hashes=Markup("".join(map(_digest, style_texts))),
        **context,
    )


def require_summary(folder: Path) -> Summary:
    """The summary of a run folder; raises InvalidScene where there is none."""
    path = folder / "summary.json"
    if why := unfit(path):
        raise InvalidScene(
            f"{folder} is no finished run folder: {path.name} {why}; run the scene first."
        )
    try:
        return Summary.model_validate_json(path.read_text(encoding="utf-8"))
    except (ValidationError, UnicodeDecodeError):
        raise InvalidScene(
            f"{path} is not a summary of this program; run the scene again."
        ) from None


def harmless_json(data: dict[str, Any]) -> str:
    """JSON in which no browser finds the end of a script, whatever names hold."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.translate({ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"})


def _digest(content: str) -> str:
    """A script or style as the page's security policy names it."""
    return f" 'sha256-{b64encode(sha256(content.encode()).digest()).decode()}'"
