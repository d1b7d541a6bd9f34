"""Errors of a mesh."""
