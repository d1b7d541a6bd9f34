"""Compiled numerics of the chain: contact laws, marches, static state, sensitivities.

A part that a chain lacks is `None`, and its branch is not compiled. numba finds that out of an
argument, not of a field: a function that asks whether a part is there takes the part itself.

Functions named by a verb change their arrays in place. All displacements of the modes are measured
from the static state, so that a chain at rest in equilibrium stays there exactly.
"""
