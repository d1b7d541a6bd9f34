"""Studies of a chain: every scheme over its step, growing chains, growing walls."""

from collections.abc import Iterable
from itertools import chain as joined

import numpy as np

import dem
from dem.spheres import force_scale
from workflows import figures
from workflows.accuracy import peers
from workflows.accuracy.accuracy import Row, Study
from workflows.accuracy.peers import Problem
from workflows.accuracy.work_precision import (
    CONTROLLED,
    Reference,
    controlled_rows,
    growth,
    growth_exponent,
    limit,
    peer_rows,
    ratio_sentences,
    reference,
    scheme_row,
    scheme_rows,
)
from workflows.chain_stages import chain, initial_velocity, require_start
from workflows.figures import Curve
from workflows.run_folder import Picture
from workflows.scene import InvalidScene, Scene
from workflows.stages import Watch, pipeline_of

LENGTHS = (17, 100, 1000, 10000)
MODES = (0, 1, 10, 50, 150, 500)
COMPARED = 150  # wall modes with which all others are run
SPACING, MASS = 400.0, 4.2  # [Hz], [kg] of the block in the synthetic wall
N_SAVE = 100
FIXED = "rkn6"  # what sizes are compared with, at one step for all
PEER_TOLERANCE = 1e-8
DRAWN = ("verlet", "rkn4", "rkn6", "rkn6a", "suzuki4", "energy4", CONTROLLED)


def problem(scene: Scene, watch: Watch) -> Problem:
    """The scene's chain; raises InvalidScene for what the integrators cannot be given."""
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-rigid.")
    if scene.contact.law != "hertz":
        raise InvalidScene(
            f'contact.law = "{scene.contact.law}" keeps a history, which the integrators beside '
            'ours do not know; set contact.law = "hertz" and drop contact.yield_pressure.'
        )
    require_start(scene)
    row, wall = chain(scene), pipeline_of(scene, watch)("wall")
    if not isinstance(wall, dem.Wall | None):
        raise InvalidScene(
            f"the scene {scene.name} has a wall whose modes its dampers couple, which no scheme of "
            "this study marches; leave out the dashpots of the joints."
        )
    seen = scene.output.spheres or range(1, scene.chain.count + 1)
    v0, duration = initial_velocity(scene), scene.time.duration
    return Problem(row, wall, v0, duration, np.array(seen) - 1, N_SAVE)


def time(scene: Scene, watch: Watch) -> Study:
    """Every scheme over its step beside general-purpose integrators over their tolerance."""
    case = problem(scene, watch)
    truth = reference(case)
    rows = (
        *scheme_rows("time", case, truth, dem.SCHEMES),
        *controlled_rows("time", case, truth),
        *peer_rows("time", case, truth, peers.peers()),
    )
    findings = (_agreement(scene.name, truth), *order_sentences(case, rows))
    return Study(
        rows,
        (*findings, *ratio_sentences(rows, scene.name), *_absent()),
        (_work_precision("accuracy_time", rows, scene.name),),
    )


def _absent() -> tuple[str, ...]:
    wheel = "CVODE is not installed; ./install.sh peers puts it beside the others."
    return () if peers.has_sundials() else (wheel,)


def _agreement(where: str, truth: Reference) -> str:
    return (
        f"{where}: the reference, {truth.one} with a small step, differs from {truth.other} "
        f"by {truth.difference:.2g}."
    )


def _work_precision(name: str, rows: Iterable[Row], title: str) -> Picture:
    rows = list(rows)
    curves = [_curve(rows, method, True) for method in DRAWN]
    curves += [_curve(rows, method, False) for method in peers.peers()]
    return Picture(name, figures.work_precision([c for c in curves if len(c.x)], title))


def _curve(rows: list[Row], method: str, ours: bool) -> Curve:
    runs = sorted((row for row in rows if row.method == method), key=lambda row: -row.setting)
    points = np.array([(1e3 * row.seconds, row.error) for row in runs])
    return Curve(method, *points.reshape(-1, 2).T, ours)


def order_sentences(case: Problem, rows: Iterable[Row]) -> tuple[str, ...]:
    """Observed order of each scheme, contacts pressed shut, and on the case as it is."""
    shut = _pressed(case)
    truth = reference(shut, independent=False)
    closed = tuple(scheme_rows("order", shut, truth, dem.SCHEMES, until=2e-9))
    return (
        "order while contacts stay closed: " + _orders(closed, 2e-9, last=2),
        "order where they open and close: " + _orders(rows, 1e-8, last=4),
    )


def _pressed(case: Problem) -> Problem:
    """The case between a spring on the first sphere and a rigid wall, hit too softly to open."""
    n = case.v0.size
    scale = float(np.abs(case.v0).max())
    peak = force_scale(case.chain.mass[0], case.chain.A[0], scale)
    first = np.eye(n)[0]
    stiffness = 0.01 * peak ** (1 / 3) * case.chain.A[0] ** (2 / 3)
    row = case.chain._replace(leaf_stiffness=stiffness * first, leaf_anchor=None, preload=0.0)
    A = row.A if row.A.size == n else np.append(row.A, row.A[-1])
    squeezed = n * (peak / A.min()) ** (2 / 3) + peak / stiffness
    row = row._replace(A=A, leaf_anchor=squeezed * first)
    return case._replace(chain=row, wall=dem.rigid_wall(), v0=0.01 * case.v0, n_save=10)


def _orders(rows: Iterable[Row], floor: float, last: int) -> str:
    rows = tuple(rows)
    return ", ".join(f"{name} {_order(rows, name, floor, last)}" for name in dem.SCHEMES)


def _order(rows: tuple[Row, ...], scheme: str, floor: float, last: int) -> str:
    """Over the smallest steps whose error stands above the floor."""
    clear = [row for row in rows if row.method == scheme and floor < row.error < 0.1][-last:]
    if len(clear) < 2:
        return "-"
    return f"{growth_exponent((r.setting for r in clear), (r.error for r in clear)):.2f}"


def chain_length(scene: Scene, watch: Watch) -> Study:
    """The scene's chain with more and more spheres, a fixed duration and a fixed step."""
    case = problem(scene, watch)
    rows = tuple(joined.from_iterable(_length_rows(lengthened(case, n)) for n in LENGTHS))
    return Study(
        rows,
        (_growth(rows, "spheres"),),
        (_growth_picture("accuracy_chain_length", rows, "spheres"),),
    )


def lengthened(case: Problem, n: int) -> Problem:
    """The case with n spheres, the middle one repeated."""
    chain, old = case.chain, case.v0.size
    if n <= old:
        return case
    spheres = np.r_[: old // 2, np.full(n - old, old // 2), old // 2 : old]
    contacts = spheres[: chain.A.size - old] if chain.A.size < old else spheres
    per_sphere = {
        name: values[spheres]
        for name in ("mass", "radius", "leaf_stiffness", "leaf_anchor")
        if (values := getattr(chain, name)) is not None
    }
    v0 = np.where(np.arange(n) < old, np.resize(case.v0, n), 0.0)
    return case._replace(chain=chain._replace(A=chain.A[contacts], **per_sphere), v0=v0)


def _length_rows(case: Problem) -> tuple[Row, ...]:
    n = case.v0.size
    finer = 512.0 if n <= 100 else 128.0 if n <= 1000 else 32.0
    truth = reference(case, finer=finer, independent=n <= 1000)
    solvers = {name: peers.SCIPY[name] for name in ("RK45", "DOP853")}
    return (
        scheme_row("chain-length", case, truth, FIXED, limit(case, FIXED) / 8.0, n),
        scheme_row("chain-length", case, truth, "verlet", limit(case, "verlet") / 64.0, n),
        *peer_rows("chain-length", case, truth, solvers, parameter=n, tolerances=(PEER_TOLERANCE,)),
    )


def wall_modes(scene: Scene, watch: Watch) -> Study:
    """The scene's chain before walls of more and more modes."""
    case = problem(scene, watch)
    cases = {k: case._replace(wall=modal_wall(case.wall, k)) for k in MODES}
    step = limit(cases[0], FIXED) / 64.0
    rows = tuple(joined.from_iterable(_mode_rows(one, step, k) for k, one in cases.items()))
    compared = tuple(row for row in rows if row.parameter == COMPARED)
    where = f"{scene.name} with {COMPARED} wall modes"
    return Study(
        rows,
        (_wall_sentence(case.wall), *ratio_sentences(compared, where), _mode_growth(rows)),
        (
            _work_precision("accuracy_wall_modes", compared, where),
            _growth_picture("accuracy_mode_growth", rows, "wall modes"),
        ),
    )


def modal_wall(wall: dem.Wall | None, count: int) -> dem.Wall:
    """The wall's own modes, continued at equal spacing by those of a free block."""
    wall = dem.rigid_wall() if wall is None else wall
    own = min(count, wall.omega.size)
    lowest = wall.omega[own - 1] + 2 * np.pi * SPACING if own else 2 * np.pi * 50.0
    more = lowest + 2 * np.pi * SPACING * np.arange(count - own)
    return wall._replace(
        omega=np.append(wall.omega[:own], more),
        zeta=np.append(wall.zeta[:own], np.zeros(count - own)),
        phi=np.append(wall.phi[:own], np.full(count - own, np.sqrt(2.0 / MASS))),
    )


def _wall_sentence(wall: dem.Wall | None) -> str:
    own = 0 if wall is None else wall.omega.size
    if own >= MODES[-1]:
        return "wall modes: the scene's own."
    first = "none of its own" if own == 0 else f"{own} of its own"
    return (
        f"wall modes: the scene has {first}; synthetic ones follow, undamped, every "
        f"{SPACING:g} Hz with the participation of a block of {MASS:g} kg."
    )


def _mode_rows(case: Problem, rigid_step: float, k: int) -> tuple[Row, ...]:
    truth = reference(case)
    fixed = scheme_row("wall-modes", case, truth, FIXED, rigid_step, k)
    if k != COMPARED:
        dop = {"DOP853": peers.SCIPY["DOP853"]}
        return fixed, *peer_rows(
            "wall-modes", case, truth, dop, parameter=k, tolerances=(PEER_TOLERANCE,)
        )
    return (
        fixed,
        *scheme_rows("wall-modes", case, truth, DRAWN[:-1], parameter=k),
        *peer_rows("wall-modes", case, truth, peers.peers(), parameter=k),
    )


def _growth(rows: tuple[Row, ...], size: str) -> str:
    """Time at a fixed step or tolerance: what is fixed, what each adds, how the rest grows."""
    methods = dict.fromkeys(row.method for row in rows)
    said = (_growth_of(name, [row for row in rows if row.method == name]) for name in methods)
    return f"time over the number of {size}: " + "; ".join(said)


def _growth_of(name: str, rows: list[Row]) -> str:
    found = growth([row.parameter for row in rows], [row.seconds for row in rows])
    return (
        f"{name} {1e3 * found.fixed:.2g} ms + {1e6 * found.each:.2g} µs for each, the second part "
        f"to the power of {found.exponent:.2f}"
    )


def _mode_growth(rows: tuple[Row, ...]) -> str:
    """What modes cost at a fixed step."""
    rigid, *more = _fixed(rows, FIXED)
    found = growth([row.parameter for row in more], [row.seconds for row in more])
    return (
        f"{FIXED} at a fixed step: {1e3 * rigid.seconds:.3g} ms with a rigid wall; over the number "
        f"of wall modes {1e3 * found.fixed:.3g} ms + {1e6 * found.each:.2g} µs for each, the "
        f"second part to the power of {found.exponent:.2f}"
    )


def _fixed(rows: Iterable[Row], method: str) -> list[Row]:
    """One row for each size, the first: the same setting for all."""
    first = {}
    for row in rows:
        if row.method == method:
            first.setdefault(row.parameter, row)
    return [first[size] for size in sorted(first)]


def _growth_picture(name: str, rows: tuple[Row, ...], size: str) -> Picture:
    """Times of the methods that were run at all sizes."""
    runs = {method: _fixed(rows, method) for method in dict.fromkeys(row.method for row in rows)}
    longest = max(map(len, runs.values()))
    curves = [
        Curve(
            f"{method}, {_setting(found[0])}",
            np.array([max(row.parameter, 0.5) for row in found]),
            np.array([1e3 * row.seconds for row in found]),
            method in dem.SCHEMES,
        )
        for method, found in runs.items()
        if len(found) == longest
    ]
    return Picture(name, figures.growth(curves, f"number of {size}"))


def _setting(row: Row) -> str:
    if row.method in dem.SCHEMES:
        return f"step {1e6 * row.setting:.2g} µs"
    return f"tolerance {row.setting:.0e}"
