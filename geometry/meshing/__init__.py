"""Elements on the shapes: sizes, grid lines, hexahedra, tetrahedra."""
