"""Run time of chains of more and more spheres, and before walls of more and more modes, at a fixed
step or tolerance."""

import numpy as np

from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.curves import (
    DRAWN,
    TimeGrowth,
    at_one_setting,
    growth,
    over_size,
    picture,
    ratios,
)
from beadwave.workflows.evidence.accuracy.problems import (
    MASS,
    SPACING,
    lengthened,
    modal_wall,
    problem,
)
from beadwave.workflows.evidence.accuracy.runs import (
    CONTROLLED,
    FIXED,
    limit,
    peer_rows,
    reference,
    scheme_row,
    scheme_rows,
    table_of,
)
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.required_parts import with_wall
from beadwave.workflows.stages.engine.progress import Progress

LENGTHS = (17, 100, 1000, 10000)  # spheres
MODES = (0, 1, 10, 50, 150, 500)
COMPARED = 150  # wall modes with which all others are run


def chain_length(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of spheres."""
    case = problem(scene, progress)
    solvers = {name: peers.SCIPY[name] for name in ("RK45", "DOP853")}
    rows = []
    for length in LENGTHS:
        chain = lengthened(case, length)
        n = chain.v0.size
        # a long chain's reference takes larger steps, and is not checked by DOP853 beyond 1000
        finer = 512.0 if n <= 100 else 128.0 if n <= 1000 else 32.0
        truth = reference(chain, finer=finer, independent=n <= 1000)
        for scheme, share in ((FIXED, 8.0), ("verlet", 64.0)):
            dt = limit(chain, scheme) / share
            rows.append(scheme_row("chain-length", chain, truth, scheme, dt, n))
        rows += peer_rows("chain-length", chain, truth, solvers, parameter=n, tolerances=(1e-8,))
    rows = tuple(rows)

    growths = []
    for method in dict.fromkeys(row.method for row in rows):
        runs = [row for row in rows if row.method == method]
        line = growth([row.parameter for row in runs], [row.seconds for row in runs])
        growths.append(f"{method} {_growing(line, 'sphere', 2)}")
    sentence = (
        "Run time over the number of spheres, a straight line with the exponent of what it adds: "
        f"{'; '.join(growths)}."
    )
    curves = over_size("accuracy_chain_length", rows, "spheres")
    return Finding((table_of(rows),), (sentence,), (curves,))


def wall_modes(scene: Scene, progress: Progress) -> Finding:
    """Run time against the number of modes of the wall."""
    with_wall(scene)
    case = problem(scene, progress)
    dt = limit(case._replace(wall=modal_wall(case.wall, 0)), FIXED) / 64.0  # of the rigid wall

    # one scheme and one step at all numbers of modes; every scheme and peer at one of them
    rows = []
    for k in MODES:
        modal_case = case._replace(wall=modal_wall(case.wall, k))
        truth = reference(modal_case)
        rows.append(scheme_row("wall-modes", modal_case, truth, FIXED, dt, k))
        if k == COMPARED:
            schemes = [name for name in DRAWN if name != CONTROLLED]
            rows += scheme_rows("wall-modes", modal_case, truth, schemes, parameter=k)
            rows += peer_rows("wall-modes", modal_case, truth, peers.peers(), parameter=k)
            continue
        dop853 = {"DOP853": peers.SCIPY["DOP853"]}
        rows += peer_rows("wall-modes", modal_case, truth, dop853, parameter=k, tolerances=(1e-8,))
    rows = tuple(rows)

    n_modes = 0 if case.wall is None else case.wall.omega.size
    walls = "All modes of the wall are the scene's own."
    if n_modes < MODES[-1]:
        walls = (
            f"The wall has {n_modes or 'no'} modes of its own; synthetic ones follow, undamped, "
            f"every {SPACING:g} Hz with the participation factor of a block of {MASS:g} kg."
        )
    compared = tuple(row for row in rows if row.parameter == COMPARED)
    title = f"{scene.name} with {COMPARED} wall modes"
    rigid, *with_modes = at_one_setting(rows, FIXED)
    line = growth([row.parameter for row in with_modes], [row.seconds for row in with_modes])
    cost = (
        f"{FIXED} at a fixed step takes {1e3 * rigid.seconds:.3g} ms with a rigid wall, and with "
        f"modes {_growing(line, 'mode', 3)}."
    )
    pictures = (
        picture("accuracy_wall_modes", compared, title),
        over_size("accuracy_mode_growth", rows, "wall modes"),
    )
    return Finding((table_of(rows),), (walls, *ratios(compared, title), cost), pictures)


def _growing(line: TimeGrowth, of: str, digits: int) -> str:
    exponent = "-" if np.isnan(line.exponent) else f"{line.exponent:.2f}"
    return (
        f"{1e3 * line.fixed:.{digits}g} ms + {1e6 * line.each:.2g} µs for each {of}, exponent "
        f"{exponent}"
    )
