"""Stiff and extreme chains and walls, each run held against a finer one."""
