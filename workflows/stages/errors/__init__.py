"""Errors of a run: the run again with a better model, the difference is the error."""
