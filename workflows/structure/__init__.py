"""Work on an assembly apart from a run: tuning, hammer tests, tables of modes."""
