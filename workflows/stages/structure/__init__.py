"""Stages of a structure: from bodies to modes, reduced model and their health."""
