"""Stages that draw and lay out what a run shows."""
