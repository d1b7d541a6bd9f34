"""What each optional part of a scene costs: the same step and scheme with one part more."""

import numpy as np

import dem
from coupling.peers import Problem
from coupling.work_precision.problems import modal_wall
from coupling.work_precision.rows import Row
from coupling.work_precision.runs import marched, observed, relative_error, timed
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import table_of
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
SCHEMES = ("verlet", "suzuki4")


def parts(scene: Scene, progress: Progress) -> Finding:
    """Run time at a given step with each optional part of a chain and of a wall."""
    case = problem(scene, progress)
    case = case._replace(wall=modal_wall(None, 0), chain=_bare(case.chain))
    rows = tuple(
        _part_row(name, one, scheme) for scheme in SCHEMES for name, one in with_parts(case).items()
    )
    sentences = rendered(__file__, ratios={scheme: _over_bare(rows, scheme) for scheme in SCHEMES})
    return Finding((table_of(rows),), sentences)


def _over_bare(rows: tuple[Row, ...], scheme: str) -> dict[str, float]:
    """Time with a part over that of the bare chain."""
    bare, *others = (row for row in rows if row.method.startswith(f"{scheme},"))
    return {row.parameter: row.seconds / bare.seconds for row in others}


def _bare(chain: dem.Chain) -> dem.Chain:
    return dem.Chain(chain.mass, chain.radius, chain.A)


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
    return {name: case._replace(chain=one) for name, one in chains.items()} | {
        name: case._replace(wall=one) for name, one in walls.items()
    }


def _part_row(name: str, case: Problem, scheme: str) -> Row:
    dt = case.duration / 20000
    run = timed(lambda: marched(case, scheme, dt))
    finer = observed(case, marched(case, scheme, dt / 2).v)
    error = relative_error(case, run.result.v, finer)
    steps = run.result.n_steps
    return Row(
        "parts", f"{scheme}, {name}", name, error, run.warm, run.result.energy_error, steps,
        steps * dem.SCHEMES[scheme].evaluations, run.cold, run.result.dt,
    )  # fmt: skip
