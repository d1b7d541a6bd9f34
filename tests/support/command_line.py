"""The command line as tests call it."""

import sys

import pytest

from beadwave.workflows.commands.app import main

COARSE_RIG = (
    "mesh.seed=0.012", "mesh.block_seed=0.05", "mesh.support_seed=0.1",
    "mesh.contact_seed=0.012", "patch.radius=0.006",
)  # fmt: skip
COARSE_RUN = (*COARSE_RIG, "reduction.modes=30", "output.samples=601")


def beadwave(*arguments):
    """The exit status of a command."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(sys, "argv", ["beadwave", *map(str, arguments)])
        main()
    return end.value.code or 0
