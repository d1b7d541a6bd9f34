"""Data of the report page, made from the files of the run once and kept: to read the reduced model
and to thin its surface takes longer than all else that a run of kept results does."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from beadwave.workflows.report.page_data import page_data
from beadwave.workflows.report.summary import ChainNumbers, StructureNumbers, Summary
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.toml import toml


def data(
    scene: Scene, *results: dict[str, bytes] | ChainNumbers | StructureNumbers
) -> dict[str, Any]:
    """Data that the page's scripts read (`report.page_data`): files by name, and numbers."""
    numbers: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        Path(folder, "scene.toml").write_text(toml(scene), encoding="utf-8", newline="\n")
        for result in results:
            if not isinstance(result, dict):
                numbers |= result.numbers
                continue
            for name, content in result.items():
                path = Path(folder, name)
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(content)
        # as it is read back, without what JSON does not know
        text = Summary(scene=scene.name, **numbers).text()
        return page_data(Path(folder), Summary.model_validate_json(text))
