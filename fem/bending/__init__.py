"""Beams and plates without a mesh of solids."""
