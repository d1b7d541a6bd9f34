"""Pieces of a sweep's work: cases computed together, and what tasks share."""

from typing import NamedTuple

from workflows.scene import Scene
from workflows.sweep.cases import Checked


class Task(NamedTuple):
    """Cases computed together."""

    checked: Checked
    signals: bool


class Sharing(NamedTuple):
    """Tasks on one wall; those of the same key share their reduced models too."""

    scene: Scene | None  # of the first case; None where all are refused
    key: str | None
    tasks: list[Task]
