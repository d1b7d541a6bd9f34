"""Shapes drawn or read from STEP, their faces, holes and contacts."""
