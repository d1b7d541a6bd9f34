"""Files that a user gives or gets: run folders, meshes, walls, measured signals."""
