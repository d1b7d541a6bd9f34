"""A scene's stages, from the mesh to the waves, each kept by content."""
