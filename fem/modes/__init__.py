"""Modes of a model, their correlation, and the solvers behind both."""
