"""The `beadwave` command: what each of its words takes, and what it prints."""
