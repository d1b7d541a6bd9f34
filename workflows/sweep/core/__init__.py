"""Numerics of sweeps: designs of cases, rows of the table, effects of the numbers that vary."""
