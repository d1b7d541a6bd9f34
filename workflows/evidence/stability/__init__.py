"""Stiff and extreme chains and walls, each run compared with a finer one."""
