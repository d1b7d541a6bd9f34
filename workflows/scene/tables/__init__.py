"""The tables of a scene, one file each."""
