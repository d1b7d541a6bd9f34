"""Contradictions between tables, and limits of what a scene may ask for."""
