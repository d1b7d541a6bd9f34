"""Crystals: their packing, its march, numbers, files and figures."""
