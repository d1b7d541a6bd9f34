"""Models as Abaqus and CalculiX read them."""
