"""Modes, damping and shapes from measured hits and records."""
