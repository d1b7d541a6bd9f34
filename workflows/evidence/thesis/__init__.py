"""Figures and statements of the thesis computed again, each beside the corrected method."""
