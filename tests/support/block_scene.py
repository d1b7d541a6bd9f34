"""A chain of two spheres before a block, with sensors on its faces."""

from contextlib import nullcontext

from beadwave.workflows.stages.engine.pipeline import pipeline_of

BLOCK = """
chain = { count = 2, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.1 }
preload = { force = 10.0 }
time = { duration = 1e-4 }
wall = { kind = "rom" }
materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
assembly = { held = ["block:-z"], material = "steel" }
bodies = { block = { box = [0.06, 0.05, 0.04], seed = 0.02 } }
reduction = { modes = 8, to_hz = 5e3 }
[strike]
on = "block:+x"
at = [0.005, 0.004]
radius = 2e-3
seed = 8e-3
"""
SENSORS = (
    '{ on = "block:+y", quantity = "acceleration", direction = "y" }',
    '{ on = "block:+x", at = [-0.015, 0.0], radius = 3e-3, quantity = "velocity", '
    'direction = "normal", gain = 2.0 }',
    '{ on = "block:+z", quantity = "displacement", direction = [1, 0, 0] }',
    '{ sphere = 1, quantity = "force" }',
)
SENSED = f"output.sensors=[{', '.join(SENSORS)}]"


def pipeline(of):
    return pipeline_of(of, lambda name: nullcontext())
