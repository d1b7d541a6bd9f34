"""Bodies, joints, springs and supports: K and M of an assembly."""
