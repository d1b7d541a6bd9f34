"""Solitary waves in the records of a chain.

arrivals     peaks in the record of one sphere
tracks       pulses of contact force, linked to waves from contact to contact
labels       which wave passes a sphere when, by its track
fit          overlapping waves, separated by least squares
measures     contact time, speeds, TOF and ARR as the literature defines them
solitary     shape, speed and force of the wave of equal spheres
"""
