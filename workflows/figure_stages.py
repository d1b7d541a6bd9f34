"""The stages that draw: kept like any other result, so that a repeated run draws nothing."""

from coupling import Impact
from workflows import figures
from workflows.run_folder import Picture
from workflows.scene import Scene


def of_chain(scene: Scene, impact: Impact) -> tuple[Picture, ...]:
    """Velocities of the observed spheres and the energy ledger."""
    observed = scene.output.spheres or (1, scene.chain.count)
    trajectory = impact.trajectory
    return (
        Picture("velocities", figures.velocities(trajectory.t, trajectory.v, observed)),
        Picture("energies", figures.energies(trajectory.t, trajectory._asdict())),
    )
