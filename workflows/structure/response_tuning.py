"""A model fitted to the frequency responses of a test: from a scene and a file to a tuned scene.

Poles of the responses are identified and paired with computed modes, values are brought to their
frequencies, and from there to the responses at all lines; the full model is the judge.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.sparse import csr_matrix, vstack

from beadwave import fem
from beadwave.fem.identification.measured_shapes import FEWEST
from beadwave.fem.identification.response_scale import POWERS, remark_on_scale, response_scale
from beadwave.fem.modes.mac import FROM_AFAR, mac_near_double, measured_pairs, paired
from beadwave.fem.updating.response_fit import (
    MeasuredResponses,
    Resonances,
    ResponseFit,
    fit_responses,
    undetermined,
)
from beadwave.fem.updating.response_model import (
    DampingParameter,
    Parameter,
    ResponseModel,
    computed_responses,
    response_model,
    solid_ones,
    with_dampings,
)
from beadwave.fem.updating.tuning import (
    TuningBasis,
    TuningParameter,
    at_before,
    spectrum,
    tune,
    tuning_basis,
)
from beadwave.workflows.files.hammer import Reading
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.number_format import supported
from beadwave.workflows.scene import InvalidScene, Scene, nearest
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.structure import dampings as of_damping
from beadwave.workflows.structure.hammer import (
    PHASES,
    IdentifiedTest,
    hammer_test,
    points_without_place,
)
from beadwave.workflows.structure.measured_responses import (
    MAX_LOADS,
    MAX_MODES,
    OPPOSITE_CORRELATION,
    PROJECTION_REACH,
    SIGNIFICANT_RISE,
    Places,
    measured_lines,
    resonances_chosen,
    test_places,
)
from beadwave.workflows.structure.parameters import at_values, freed, from_drawing, known, on_bodies
from beadwave.workflows.structure.response_report import (
    Fitted,
    ResponseReport,
    full_model,
    pictures,
    response_report,
)
from beadwave.workflows.structure.tuning import loosened

# relative, of identified frequencies together with the responses, as `tune` takes it, and of their
# damping ratios; 3 deviations at least, so that what the responses say already hardly counts twice
FREQUENCY_ERROR, ZETA_ERROR = 1e-3, 0.02


ABOVE = 1.1  # of the highest resonance: the band without one of the user's; not varied


class TunedResponses(NamedTuple):
    """The scene with fitted values, its report and the pictures of responses."""

    scene: Scene
    report: ResponseReport
    pictures: tuple[Picture, ...]


def tuned_to_responses(
    scene: Scene,
    files: Sequence[Path],
    free: tuple[str, ...],
    progress: Progress,
    *,
    reading: Reading = Reading(),
    band_hz: tuple[float, float] | None = None,
    match: Sequence[int] | None = None,
) -> TunedResponses:
    """The scene fitted to the responses in the files, at the lines in a band and around the
    resonances numbered in `match`, all without; raises InvalidScene."""
    named = ", ".join(map(str, files))

    # the test: poles of its responses, which must know the force that made them
    if scene.measured:
        raise InvalidScene(
            f"{scene.name}: measured.{scene.measured[0].name} has damping of its own, which a fit "
            "to responses does not take; fit frequencies, beadwave tune without --frf."
        )
    with progress("identification"):
        test = hammer_test(list(files), {}, reading)
    if records := test.test.without_force:
        raise InvalidScene(
            f"{named} has {records} without a force, of which the height of responses is not "
            "known; give hits or frequency responses."
        )
    scene, deviations = from_drawing(scene, free, progress) if any(free) else (scene, {})
    solids, of_dampings = parameters_named(scene, free, deviations)
    of_damping.require_damped(scene, of_dampings)

    # the test on the model with springs that can vary
    loose = loosened(scene, solids)
    pipeline = pipeline_of(loose, progress)
    model = pipeline("model")
    places = test_places(scene, model, test)
    steps = [step.text() for step in test.report.steps]
    remarks = list(test.report.remarks)
    quantity = test.test.quantity
    if not quantity:
        quantity = "accelerations"
        remarks.append(
            f"{named} does not say what its responses are: accelerations in m/s^2 over N are taken."
        )

    # the lines that are fitted, and a projection whose modes reach well beyond them
    top_hz = ABOVE * float(test.modes.frequency_hz.max())
    band_hz = band_hz or (0.0, top_hz)
    chosen = resonances_chosen(test, band_hz, match)
    data, n_lines = measured_lines(test, places, band_hz, chosen)
    with progress("tuning-basis"):
        basis, top = response_basis(model, test, places, data.frequency_hz[-1])
    if top < PROJECTION_REACH * data.frequency_hz[-1]:
        raise InvalidScene(
            f"--band: {MAX_MODES} modes reach to {top:.5g} Hz, which is not "
            f"{PROJECTION_REACH:g} times the highest line at {data.frequency_hz[-1]:.5g} Hz; give "
            f"a band up to {top / PROJECTION_REACH:.0f} Hz."
        )
    solids = on_bodies(scene, solids, list(basis.forms))

    # what besides K and M makes responses: damping of parts, the power of i omega of the quantity,
    # the decay that an exponential window adds, springs between points
    material = {body: scene.material_name(body) or "" for body in model.structure.basis}
    damping = of_damping.structure_damping_of(scene, material, of_dampings)
    beside = {
        f"{one.name}.{key}": k for one in scene.springs or () for key, k in one.stiffnesses.items()
    }
    made = (damping, POWERS[quantity], test.test.responses.shift, beside)
    parameters: list[Parameter] = [*solids, *of_dampings]

    # the model before the fit, and the resonances that it has: a sensor that looks the other way or
    # a wrong unit would be fitted by wrong values
    started = perf_counter()
    before = unfitted(basis, solids, made)
    near, resonances = resonances_near(before, test, chosen)
    require_signs_and_size(named, test, before, near, quantity)

    # values that meet the frequencies of the poles, then the damping of these
    n_shapes = len(basis.targets) - 2
    start = np.array([p.start for p in parameters])
    steps.append(pairing_step(test, near, chosen, n_shapes))
    if len(near) and solids:
        hz = test.modes.frequency_hz[near]
        fit = tune(of_these(basis, near), solids, dict(enumerate(hz.tolist(), start=1)))
        start[: len(solids)] = fit.value
        met = np.abs(np.log(fit.modes_hz / hz))
        steps.append(
            f"values brought to the frequencies of these {len(near)}: off by "
            f"{100 * np.nanmax(met):.2g} % at most."
        )
    if len(near) and of_dampings:
        start = damping_start(response_model(basis, *made), parameters, start, test, near)
    subset = basis._replace(targets=(*of_these(basis, near).targets, *basis.targets[-2:]))
    model_of = response_model(subset, *made)

    # from there, and from the scene's own values, to the responses at all lines
    with progress("tuning"):
        starts = [start, np.array([p.start for p in parameters])]
        of_poles = resonances if len(near) else None
        fits = [fit_responses(model_of, parameters, x, data, of_poles) for x in starts]
        fit = min(fits, key=lambda one: one.objective)
        # what the responses do not determine would take any value: it goes back to the scene's
        fit, model_of, evaluations = determined(subset, made, fit, data, of_poles)
    evaluations += sum(one.evaluations for one in fits)
    seconds = perf_counter() - started
    steps.append(
        f"{len(parameters)} values fitted to {data.H[..., 0].size} responses at "
        f"{len(data.frequency_hz)} of {n_lines} lines between {data.frequency_hz[0]:.5g} and "
        f"{data.frequency_hz[-1]:.5g} Hz, magnitude in dB and phase, with the frequencies of the "
        "paired resonances and, where damping is free, their damping ratios."
    )
    if not fit.parameters:
        raise InvalidScene(
            f"{scene.name}: no value of --free {','.join(p.name for p in parameters)} is "
            "determined by these responses, nothing is tuned; free what moves their resonances."
        )

    # values to the digits that their deviations support, in the scene and in the full model, which
    # judges the projection
    fitted = [supported(x, x * s) for x, s in zip(fit.value, fit.deviation, strict=True)]
    fit = fit._replace(value=np.array(fitted))
    result = with_fitted(scene, fit)

    of_fit = Fitted(
        scene, result, test, places, fit, model_of, before, parameters, chosen, data, of_poles
    )
    full = full_model(of_fit, progress)
    report = response_report(
        of_fit, full, top / PROJECTION_REACH,
        evaluations=evaluations, seconds=seconds, steps=steps, remarks=remarks,
    )  # fmt: skip
    with progress("picture"):
        drawn = pictures(of_fit, quantity, band_hz, top)
    return TunedResponses(result, report, drawn)


def parameters_named(
    scene: Scene, names: tuple[str, ...], deviations: Mapping[str, float]
) -> tuple[list[TuningParameter], list[DampingParameter]]:
    """Parameters of stiffness and mass, with deviations of their logarithms that are known, and
    those of damping; raises InvalidScene for names that are neither, that come twice, and for
    none."""
    materials = [f"materials.{name}" for name in scene.materials]
    joints = [f"joints.{name}" for name in scene.bushings]
    springs = [f"springs.{one.name}" for one in scene.springs or ()]
    parts = [*materials, *joints, *springs]
    damped = of_damping.known_dampings(scene, parts)
    solid = known(scene)
    if not names or names == ("",):
        raise InvalidScene(
            f"--free is missing; name what to vary of {', '.join([*solid, *damped])}."
        )
    for name in names:
        if names.count(name) > 1:
            raise InvalidScene(f"--free {name} is named twice; drop one.")
        if name not in damped and name not in solid:
            why = ""
            if name.startswith("damping.") and scene.damping is not None:
                why = f' while damping.kind = "{scene.damping.kind}"'
            elif name.rpartition(".")[2][:1] == "c":
                why = " (a direction that is rigid or open has no dashpot)"
            raise InvalidScene(
                f"--free {name} is not known{why}, {nearest(name, [*solid, *damped])}."
            )
    solids = tuple(name for name in names if name not in damped)
    return (
        freed(scene, solids, deviations) if solids else [],
        of_damping.freed_dampings(scene, [name for name in names if name in damped], parts),
    )


def response_basis(
    model: fem.Model,
    test: IdentifiedTest,
    places: Places,
    highest_hz: float,
) -> tuple[TuningBasis, float]:
    """The projection with static shapes of forces at the test's points; its targets are the
    identified shapes, of three points or more, and then points and references. And the highest
    frequency [Hz] of the modes it holds.

    Modes are doubled until they reach `options.beyond` times the highest line, or are
    `options.most_modes`: the caller refuses a band that they do not reach.
    """
    phi = test.modes.phi[places.used]
    shapes = []
    if len(places.used) >= FEWEST:
        shapes = [
            places.points._replace(shape=phi[:, i], hz=float(hz))
            for i, hz in enumerate(test.modes.frequency_hz)
        ]
    readings = [csr_matrix(one.reading) for one in (places.points, places.references)]
    few = sum(one.shape[0] for one in readings) <= MAX_LOADS
    loads = csr_matrix(vstack(readings)) if few else readings[1]
    n_modes = 24
    while True:
        basis = tuning_basis(
            model, [*shapes, places.points, places.references], n_modes=n_modes, loads=loads
        )
        stiffest = spectrum(basis, [], np.zeros(0)).frequency_hz
        top = float(stiffest[min(n_modes, len(stiffest)) - 1])
        n_modes *= 2
        if top > PROJECTION_REACH * highest_hz or n_modes > MAX_MODES:
            return basis, top


def of_these(basis: TuningBasis, indices: NDArray[np.int64]) -> TuningBasis:
    """The basis with these (k,) of the identified shapes as its only targets: others have no
    part."""
    return basis._replace(targets=tuple(basis.targets[i] for i in indices.tolist()))


def unfitted(basis: TuningBasis, solids: Sequence[TuningParameter], made: tuple) -> ResponseModel:
    """The model as the scene has it, rigid directions included."""
    for p in solids:
        basis = at_before(basis, p)
    return response_model(basis, *made)


def resonances_near(
    before: ResponseModel, test: IdentifiedTest, chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], Resonances]:
    """Positions (k,) of the chosen (n,) resonances that some computed mode is like, with their
    frequencies, damping ratios and the errors of both."""
    targets = before.basis.targets[:-2]
    if not targets:
        return np.zeros(0, int), Resonances(np.zeros(0), np.zeros(0, int), *[np.zeros(0)] * 3)
    modes = spectrum(before.basis, [], np.zeros(0))
    reading = before.points @ modes.phi
    places = np.flatnonzero(chosen)
    shapes = np.column_stack([targets[i].shape for i in places.tolist()])
    pairs = measured_pairs(
        test.modes.frequency_hz[places], modes.frequency_hz,
        mac_near_double(shapes, reading, modes.frequency_hz),
        np.zeros((reading.shape[1],) * 2), FROM_AFAR,
    )  # fmt: skip
    near = places[pairs.index >= 0]
    hz = test.modes.frequency_hz[near]
    # a deviation that the blocks of an ambient record do not say is nan
    error = np.fmax(FREQUENCY_ERROR, 3 * test.modes.frequency_deviation[near] / hz)
    zeta = test.modes.zeta[near]
    of_zeta = np.fmax(ZETA_ERROR, 3 * test.modes.zeta_deviation[near] / zeta)
    return near, Resonances(hz, near, error, zeta, of_zeta)


def pairing_step(
    test: IdentifiedTest, near: NDArray[np.int64], chosen: NDArray[np.bool_], n_shapes: int
) -> str:
    """A sentence on how the resonances begin the fit: of those chosen (n,) those that are `near`
    (k,) to a computed mode."""
    n = int(np.count_nonzero(chosen))
    if not n_shapes:
        return (
            f"{n} resonances, whose shapes are known at fewer than {FEWEST} points: none is paired "
            "with a computed mode, the fit begins at the scene's values."
        )
    lost = [i for i in np.flatnonzero(chosen) if i not in near]
    listed = ", ".join(f"{test.modes.frequency_hz[i]:.5g} Hz" for i in lost)
    return f"{len(near)} of {n} resonances paired by shape with computed modes" + (
        f"; none is like {listed}." if lost else "."
    )


def damping_start(
    model: ResponseModel,
    parameters: Sequence[Parameter],
    value: NDArray[np.float64],
    test: IdentifiedTest,
    near: NDArray[np.int64],
) -> NDArray[np.float64]:
    """The values (p,) with those of damping that bring the ratios of the modes nearest to the
    measured ones (least squares without negative values; ratios are linear in them).

        zeta_i - zeta_i,0 = sum_j A_ij x_j,   A_ij = (zeta_i(x_j alone) - zeta_i,0) / x_j

    over the measured zeta_i of the resonances `near` (k,), so that errors are relative.
    """
    damped = [j for j, p in enumerate(parameters) if isinstance(p, DampingParameter)]

    def ratios(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(k,) of the modes at values x (p,); nan of a resonance that none is like."""
        computed = computed_responses(model, parameters, x, np.array([1.0]))
        index = paired(model.basis.forms, computed.modes, of_these(model.basis, near).targets).index
        return np.where(index < 0, np.nan, computed.zeta[index])

    # A by a run for each value of damping, the others zero
    without = value.copy()
    without[damped] = 0.0
    fixed = ratios(without)
    columns = []
    for j in damped:
        x = without.copy()
        x[j] = value[j]
        columns.append((ratios(x) - fixed) / value[j])
    measured = test.modes.zeta[near]
    A, b = np.column_stack(columns), measured - fixed
    known = np.isfinite(A).all(axis=1) & np.isfinite(b)
    result = value.copy()
    if known.any():
        scale = value[damped]
        weight = 1 / measured[known]  # relative errors of ratios
        x, _ = nnls(A[known] * scale * weight[:, None], np.maximum(b[known], 0) * weight)
        lower = np.array([parameters[j].lower for j in damped])
        upper = np.array([parameters[j].upper for j in damped])
        # none begins at zero, from where a logarithm does not return
        result[damped] = np.clip(np.maximum(x, 0.03) * scale, 2 * lower, 0.5 * upper)
    return result


def require_signs_and_size(
    named: str,
    test: IdentifiedTest,
    before: ResponseModel,
    near: NDArray[np.int64],
    quantity: str,
) -> None:
    """Raise InvalidScene where residues of the paired resonances `near` (k,) say that a sensor or
    the hammer looks the other way, or that a unit is another.

    The residue of a mode between point p and reference r is phi_p phi_r times a power of i omega of
    the quantity: its sign against the model's tells the directions, its size the unit.
    """
    modes = spectrum(before.basis, [], np.zeros(0))
    index = paired(before.basis.forms, modes, of_these(before.basis, near).targets).index
    near, index = near[index >= 0], index[index >= 0]
    if not len(near):
        return

    # residues (n_modes, points, references), measured and computed, and by response how well they
    # agree over the modes: 1 where all do, -1 where all are turned
    at_points, at_references = before.points @ modes.phi, before.references @ modes.phi
    used = [i for i in range(len(test.modes.phi)) if i not in set(points_without_place(test.test))]
    measured = np.einsum(
        "pn,nr->npr", test.modes.phi[np.ix_(used, near)], test.modes.participation[near]
    )
    computed = np.einsum("pn,rn->npr", at_points[:, index], at_references[:, index])
    computed = (
        computed * PHASES[quantity] * (modes.omega[index] ** (before.power - 1))[:, None, None]
    )
    along = np.sum((measured * computed.conj()).real, axis=0)
    correlation = along / np.maximum(np.sum(np.abs(measured * computed), axis=0), 1e-300)
    reversed_ones = correlation < OPPOSITE_CORRELATION

    # one mode alone may be paired with a wrong one: two must agree
    responses = test.test.responses
    if len(near) > 1 and reversed_ones.any():
        i, j = np.argwhere(reversed_ones)[0]
        point, reference = responses.points[used[i]], responses.references[j]
        which = f"{point} to {reference} moves"
        if reversed_ones[:, j].all():
            which = f"{reference} looks"
        raise InvalidScene(
            f"{named}: {which} against the model in all paired resonances: the direction of its "
            "name is not that of hammer or sensor; name it with the other sign, as 3-z for 3+z."
        )
    chosen = test.modes._replace(
        frequency_hz=test.modes.frequency_hz[near], phi=test.modes.phi[np.ix_(used, near)],
        participation=test.modes.participation[near],
    )  # fmt: skip
    scale = response_scale(chosen, quantity, at_points[:, index], at_references[:, index])
    if sentence := remark_on_scale(scale):
        raise InvalidScene(
            f"{named}: {sentence}. The height of responses is fitted: correct their unit in the "
            "file, or the mass of the model."
        )


def determined(
    basis: TuningBasis,
    made: tuple,
    fit: ResponseFit,
    data: MeasuredResponses,
    resonances: Resonances | None,
) -> tuple[ResponseFit, ResponseModel, int]:
    """The fit of what the responses determine: what they do not has the value it had before, and
    directions that were rigid stay so where the others alone explain the responses as well."""
    evaluations, model = 0, response_model(basis, *made)
    while fit.parameters:
        rigid = [
            p for p in fit.parameters
            if isinstance(p, TuningParameter) and p.springs and min(p.before) > p.upper
        ]  # fmt: skip
        for dropped in [*undetermined(fit), *rigid]:
            # the others fitted again, this one as it was in the scene
            places = [j for j, p in enumerate(fit.parameters) if p is not dropped]
            remaining = [fit.parameters[j] for j in places]
            reduced, of_damping_now = basis, made[0]
            if isinstance(dropped, TuningParameter):
                reduced = at_before(basis, dropped)
            else:
                of_damping_now = with_dampings(made[0], [dropped], np.array(dropped.before))
            remade = (of_damping_now, *made[1:])
            without = response_model(reduced, *remade)
            refit = fit_responses(without, remaining, fit.value[places], data, resonances)
            evaluations += refit.evaluations
            is_rigid = any(dropped is p for p in rigid)
            # its compliance is zero within two deviations
            is_insignificant = fit.of_groups[fit.parameters.index(dropped)] > 0.5
            if (
                not is_rigid
                or is_insignificant
                or refit.objective <= fit.objective + SIGNIFICANT_RISE
            ):
                basis, made, model, fit = reduced, remade, without, refit
                break
        else:
            break
    return fit, model, evaluations


def with_fitted(scene: Scene, fit: ResponseFit) -> Scene:
    """The scene with the fitted values; what was loosened for the fit is as it was."""
    chosen, value = solid_ones(fit.parameters, fit.value)
    result = at_values(scene, chosen, value) if chosen else scene
    of_dampings = {
        p.name: float(x)
        for p, x in zip(fit.parameters, fit.value, strict=True)
        if isinstance(p, DampingParameter)
    }
    return of_damping.with_dampings(result, of_dampings)
