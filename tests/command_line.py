"""The command line as tests call it."""

import sys

import pytest

from workflows.commands.app import main


def beadwave(*arguments):
    """The exit status of a command."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(sys, "argv", ["beadwave", *map(str, arguments)])
        main()
    return end.value.code or 0
