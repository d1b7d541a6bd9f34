"""Work on an assembly beside a run: tuning, hammer tests, tables of modes."""
