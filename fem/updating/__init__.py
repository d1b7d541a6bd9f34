"""Parameters of a model fitted to measured modes and responses."""
