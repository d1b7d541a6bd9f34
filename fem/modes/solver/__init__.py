"""Factorisations, and responses by them."""
