"""Figures of the thesis made again, each beside its cure."""
