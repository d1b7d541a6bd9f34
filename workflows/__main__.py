"""`python -m workflows` is the `beadwave` command."""

from workflows.cli import main

main()
