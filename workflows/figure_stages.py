"""The stages that draw: kept like any other result, so that a repeated run draws nothing."""

from coupling import Impact
from workflows import figures
from workflows.chain_waves import ChainWaves
from workflows.run_folder import Picture
from workflows.scene import Scene


def of_chain(scene: Scene, impact: Impact, waves: ChainWaves) -> tuple[Picture, ...]:
    """Velocities of the observed spheres with their waves, the chain over time, the ledger."""
    observed = scene.output.spheres or (1, scene.chain.count)
    trajectory = impact.trajectory
    return (
        Picture(
            "velocities",
            figures.velocities(trajectory.t, trajectory.v, observed, _marks(waves)),
        ),
        Picture("waves", figures.space_time(trajectory.t, trajectory.v, waves.trains)),
        Picture("energies", figures.energies(trajectory.t, trajectory._asdict())),
    )


def _marks(waves: ChainWaves) -> dict[int, list[figures.Mark]]:
    """The named waves of each observed sphere."""
    return {
        sphere: [figures.Mark(figures.train_mark(label), *label.arrival[:2]) for label in named]
        for sphere, named in waves.labels.items()
    }
