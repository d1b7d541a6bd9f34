"""Stages of the chain: its wall, the impact, waves, friction and sensors."""
