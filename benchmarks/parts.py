"""Run time at a given step with each optional part of a chain and of a wall.

You will see, for velocity Verlet and a splitting of order 4 on the spheres of rig-rigid, the
milliseconds of a march with one part more, their ratio to the bare chain, and the error beside half
the step.

Run it: python benchmarks/parts.py        half a minute
"""

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy.problems import Problem, modal_wall, problem
from beadwave.workflows.evidence.accuracy.runs import marched, observed, relative_error, timed
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.stages.engine.progress import quiet

COLUMNS = ("scheme", "part", "warm [ms]", "over bare", "error")


def main(
    schemes: tuple[str, ...] = ("verlet", "suzuki4"), changes: tuple[str, ...] = ()
) -> list[tuple]:
    """Print the table of rig-rigid with these changes; returns its rows."""
    case = problem(scene("rig-rigid", changes), quiet)
    chain = dem.Chain(case.chain.mass, case.chain.radius, case.chain.A)
    bare = case._replace(wall=modal_wall(None, 0), chain=chain)
    dt, rows = bare.duration / 20000, []
    for scheme in schemes:
        bare_seconds = None
        for part, extended in with_parts(bare).items():
            finer = observed(extended, marched(extended, scheme, dt / 2).v)
            run, warm, _ = timed(lambda case=extended, s=scheme: marched(case, s, dt))
            bare_seconds = bare_seconds or warm
            error = relative_error(extended, run.v, finer)
            rows.append((scheme, part, 1e3 * warm, warm / bare_seconds, error))
    print(text(Table("parts", COLUMNS, tuple(rows))))
    return rows


def with_parts(case: Problem) -> dict[str, Problem]:
    """The bare case and the case with each part."""
    chain, n = case.chain, case.chain.mass.size
    contacts = np.ones(chain.A.size)
    yields = 1e-3 * chain.radius[0] * contacts
    chains = {
        "bare": chain,
        "leaf springs": chain._replace(leaf_stiffness=np.full(n, 1e3)),
        "preload": chain._replace(preload=10.0),
        "linear-clipped": chain._replace(dissipation="linear-clipped", gamma=10.0 * contacts),
        "hunt-crossley": chain._replace(dissipation="hunt-crossley", gamma=0.1 * contacts),
        "plastic contacts": chain._replace(yield_overlap=yields),
    }
    walls = {
        "residual spring": case.wall._replace(residual_compliance=1e-9),
        "1 wall mode": modal_wall(None, 1),
        "40 wall modes": modal_wall(None, 40),
        "dashpot wall": dem.dashpot_wall(1e4),
    }
    cases = {name: case._replace(chain=chain) for name, chain in chains.items()}
    return cases | {name: case._replace(wall=wall) for name, wall in walls.items()}


if __name__ == "__main__":
    main()
