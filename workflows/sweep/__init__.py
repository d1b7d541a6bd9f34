"""Many cases of one scene: which, how they are computed together, and the table that they leave."""
