"""Meshes of other programs: their formats, bodies and faces."""
