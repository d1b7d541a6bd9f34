"""Solitary waves in the records of a chain: found, followed, named, taken apart, measured."""
