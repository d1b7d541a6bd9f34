"""The work of each command as a function: what `import beadwave` and the commands call."""
