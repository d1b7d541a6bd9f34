"""The contact in the finite-element model: patches, half-spaces, points of a face."""
