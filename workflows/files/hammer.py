"""Hammer tests from files: responses (.csv, .uff, .mat) and time records of hits (also .wav)."""

from pathlib import Path
from re import findall, sub
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hit_records import (
    TimeRecord,
    copies,
    cut_at_hits,
    direction_named,
    node_and_axis,
    require_consistent,
    sets_of_hits,
)
from beadwave.fem.identification.hits import (
    ESTIMATORS,
    FrequencyResponses,
    HitChecks,
    Hits,
    beside,
    frequency_responses,
)
from beadwave.fem.identification.measured_shapes import POINTS, UNITS, points_of_nodes
from beadwave.fem.identification.subspace import half_spectra, is_decay
from beadwave.workflows.files.foreign import Unreadable, arrays
from beadwave.workflows.files.hit_files import (
    record_of_table,
    record_of_wav,
    records_of_data_sets,
    records_of_mat,
)
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.response_files import (
    Responses,
    data_set,
    of_data_sets,
    of_mat,
    of_table,
    require_finite,
    write_csv,
)
from beadwave.workflows.files.signal_table import TIME_RESPONSE, signal_table
from beadwave.workflows.files.uff import ENDINGS, data_sets, pyuff
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file

HAMMER = "give a hammer test as .csv, .uff, .mat or .wav"
METRES = {"m": 1.0, "mm": 1e-3}  # in a header of points
CSV = (
    "a CSV needs frequency_hz, re_1, im_1, ... or time [s], force [N], response 1 [m/s^2], ... in "
    "its header line and numbers below"
)
UFF = (
    "a universal file needs data sets 58; shapes alone (data set 55) are targets of modes and "
    "tune: [[targets]] with hz and shape = the file"
)
MAT = "a .mat file needs dt, response and force, or frequency_hz and H"
WAV = "a WAV file needs a channel of the force and one or more of responses"
WANTED = {".csv": CSV, ".mat": MAT, ".wav": WAV} | dict.fromkeys(ENDINGS, UFF)
MAT_NAMES = (
    "response", "force", "dt", "t", "points", "sensors", "frequency_hz", "H", "title", "quantity",
)  # fmt: skip


class Reading(NamedTuple):
    """Options for reading the files of a hammer test."""

    estimator: str = "H1"
    decay: float | None = None  # exponential window at the end of a record; None: no window
    force_channel: int = 1  # of WAV files, from 1; 0: none
    points: Path | None = None  # where the nodes are: .csv of node, x, y, z, or .uff

    def require(self) -> None:
        """Raise InvalidScene for an option that is none."""
        if self.estimator not in ESTIMATORS:
            raise InvalidScene(f"estimator = {self.estimator!r} must be H1, H2 or Hv.")
        if self.decay is not None and not 0 < self.decay < 1:
            raise InvalidScene(f"window = {self.decay:g} must lie between 0 and 1, as 0.01.")


class Step(NamedTuple):
    """One step from a file to modes: for an audit."""

    file: str
    step: str
    options: dict[str, float | int | str | None]
    left_out: tuple[str, ...] = ()


class MeasuredTest(NamedTuple):
    """Responses of a test, where they were measured, and how they were made."""

    responses: FrequencyResponses
    title: str
    nodes: dict[int, NDArray[np.float64]]  # points (3,) [m] by number
    steps: tuple[Step, ...]
    records: tuple[Hits, ...] = ()  # empty where the files hold responses
    kind: str = "responses"  # or "hits", "ring-downs", "ambient"
    quantity: str = ""  # "accelerations", "velocities" or "displacements" where it is known
    places: str = ""  # the files that say where the nodes are, for sentences

    @property
    def without_force(self) -> str:
        """Name of its records if they hold no force, so that the height of responses is unknown; ""
        of responses to known forces."""
        return {"ambient": "ambient records", "ring-downs": "ring-downs"}.get(self.kind, "")


def measured_test(paths: list[Path], reading: Reading = Reading()) -> MeasuredTest:
    """The responses of one test in one or more files; raises InvalidScene where there are none.

    Files hold either time records, of which responses are made, or responses at the same
    frequencies, which are put together.
    """
    records, record_names, tests, nodes, steps = [], [], [], {}, []
    of_files: list[tuple[str, str]] = []  # the quantity of each file, and its name
    for path in paths:
        content, points = content_of(path, reading)
        one = content if isinstance(content, Responses) else content[0]
        of_files.append((one.quantity, path.name))
        nodes |= points
        if isinstance(content, Responses):
            tests.append(content)
            steps.append(Step(str(path), "read responses", {"responses": len(content.H)}))
        else:
            records += content
            record_names += [
                f"record {i} of {path.name}" if len(content) > 1 else path.name
                for i in range(1, len(content) + 1)
            ]
            size = {"records": len(content), "samples": content[0].response.shape[1]}
            steps.append(Step(str(path), "read time records", size))
    if reading.points:
        nodes |= points_of_file(reading.points)

    # one kind of content, at common frequencies, with the points named where all files name them
    named = ", ".join(map(str, paths))
    try:
        quantities = {q: name for q, name in reversed(of_files) if q}
        if len(quantities) > 1:
            listed = " and ".join(f"{q} ({name})" for q, name in sorted(quantities.items()))
            raise ValueError(f"the responses are {listed}; one test needs one quantity")
        if tests and records:
            raise ValueError("some files hold responses and others time records; give one kind")
        if tests:
            first = tests[0]
            if any(not np.array_equal(t.frequency_hz, first.frequency_hz) for t in tests):
                raise ValueError("the files have different frequencies; resample them")
            ends = tuple(end for t in tests for end in t.ends)
            all_ends = ends if all(t.ends for t in tests) else ()
            whole = first._replace(H=np.concatenate([t.H for t in tests]), ends=all_ends)
            responses, sets, kind = whole.by_reference(), (), "responses"
            title, quantity = first.title, first.quantity
        else:
            again = copies(records)
            remarks = tuple(
                f"{record_names[i]} is left out: its samples are those of {record_names[j]}"
                for i, j in again.items()
            )
            distinct = [record for i, record in enumerate(records) if i not in again]
            responses, sets, step, kind = responses_of_records(distinct, reading)
            steps.append(step._replace(file=named, left_out=remarks + step.left_out))
            title, quantity = records[0].title or paths[0].stem, records[0].quantity
    except ValueError as error:
        raise InvalidScene(f"{named}: {str(error).rstrip('.')}.") from None
    places = f"--points {reading.points}" if reading.points else named
    return MeasuredTest(responses, title, nodes, tuple(steps), sets, kind, quantity, places)


def responses_of_records(
    records: list[TimeRecord], reading: Reading
) -> tuple[FrequencyResponses, tuple[Hits, ...], Step, str]:
    """Responses of time records, the hits that they are made of, the step for an audit, and of what
    kind they are, "hits", "ring-downs" or "ambient"; raises ValueError where no hit is usable."""
    pieces, remarks = cut_at_hits(records)
    sets = sets_of_hits(pieces)

    # sets of hits with the same sensors; a missing sample is named by its hit and sensor
    first = sets[0]
    for hits in sets:
        for hit, sensor, sample in np.argwhere(~np.isfinite(hits.response))[:1].tolist():
            raise ValueError(
                f"record {hit + 1} of {len(hits.response)} has NaN or inf at sensor "
                f"{hits.sensors[sensor]}, sample {sample + 1}, {sample * hits.dt:.6g} s after its "
                "start; remove that record or measure again"
            )

    # without a force and without decay: half spectra of the correlations of ambient vibration
    if first.force is None and not any(map(is_decay, first.response)):
        if len(sets) > 1:
            raise ValueError("ambient records must have the same sensors; give one set of them")
        f, H, shift = half_spectra(list(first.response), first.dt)
        against = tuple(f"with {sensor}" for sensor in first.sensors)
        spectra = FrequencyResponses(f, H, first.sensors, against, shift=shift)
        size = {"records": len(first.response), "samples": first.response.shape[2]}
        return spectra, tuple(sets), Step("", "correlations of ambient records", size), "ambient"

    # responses set by set; of several sets again with the samples of the shortest, whose lines are
    # the fewest: (samples / 2 + 1,)
    checks = HitChecks(decay=reading.decay)
    responses = [frequency_responses(hits, reading.estimator, checks) for hits in sets]
    if len(sets) > 1:
        samples = min(2 * (len(r.frequency_hz) - 1) for r in responses)
        responses = [
            frequency_responses(hits, reading.estimator, checks, samples=samples) for hits in sets
        ]
    whole = responses[0]
    for other in responses[1:]:
        whole = beside(whole, other)

    # by reciprocity: the more numerous are the points of the shapes, whichever was moved
    if first.force is not None and len(whole.references) > len(whole.points):
        whole = whole.transposed()
    remarks += whole.remarks
    options = {
        "hits": sum(len(hits.response) for hits in sets), "estimator": reading.estimator,
        "window": reading.decay, "points": len(whole.points),
        "references": len(whole.references), "lines": len(whole.frequency_hz),
    }  # fmt: skip
    kind = "hits" if first.force is not None else "ring-downs"
    made = "responses of hits" if kind == "hits" else "spectra of ring-downs"
    step = Step("", made, options, tuple(remarks))
    return whole._replace(remarks=()), tuple(sets), step, kind


def content_of(
    path: Path, reading: Reading
) -> tuple[Responses | list[TimeRecord], dict[int, NDArray[np.float64]]]:
    """Content of a file, and points (3,) [m] of nodes by number; raises InvalidScene if it has no
    hammer test."""
    ending = path.suffix.lower()
    if ending not in WANTED:
        *first, last = WANTED
        raise InvalidScene(f"{path} must end in {', '.join(first)} or {last}.")
    require_file(path, HAMMER)
    # hits at one point may be files of their own: 12+z_1.wav, 12+z_2.wav
    name = sub(r"[_ -]\d+$", "", path.stem) or path.stem
    nodes: dict[int, NDArray[np.float64]] = {}
    try:
        if ending == ".csv":
            table = signal_table(path)
            is_record = table.header[0].startswith("time")
            content = [record_of_table(table, name)] if is_record else of_table(table, path.stem)
        elif ending == ".wav":
            content = [record_of_wav(path, name, reading.force_channel)]
        elif ending == ".mat":
            variables = arrays("matlab", path, *MAT_NAMES)
            is_frf = "H" in variables
            content = of_mat(variables, name) if is_frf else records_of_mat(variables, name)
        else:
            sets = data_sets(path, 58, *POINTS, UNITS)
            nodes = points_of_nodes(sets)
            sets = [s for s in sets if s["type"] == 58]
            is_record = {s["func_type"] for s in sets} == {TIME_RESPONSE}
            content = records_of_data_sets(sets) if is_record else of_data_sets(sets)
        if isinstance(content, Responses):
            return require_finite(content), nodes
        return require_consistent(content), nodes
    except InvalidScene:
        raise
    except (Unreadable, ValueError, KeyError, IndexError, TypeError) as error:
        raise InvalidScene(
            f"{path} holds no frequency responses or hits that can be read "
            f"({_why(error)}); {WANTED[ending]}."
        ) from None
    except MemoryError:
        raise InvalidScene(f"{path} does not fit into the memory; give fewer samples.") from None


def _why(error: Exception) -> str:
    """Reason why a file cannot be used, for a sentence."""
    if isinstance(error, UnicodeDecodeError):
        return "it is no text in UTF-8"
    return " ".join(str(error).split()).rstrip(".")


def points_of_file(path: Path) -> dict[int, NDArray[np.float64]]:
    """Points (3,) [m] of nodes by number, of a .csv with node, x, y, z below a header line, which
    may name the unit, x [mm], or of a .uff; raises InvalidScene where it has none."""
    return points_and_directions(path)[0]


def points_and_directions(
    path: Path,
) -> tuple[dict[int, NDArray[np.float64]], dict[int, int]]:
    """Points as of `points_of_file`, and the directions of those that have one, "z" or "-z" in a
    fifth column, as numbers of data sets 58: 3 or -3. Raises InvalidScene."""
    require_file(path, "give points as .csv (node, x, y, z in metres) or .uff", key="--points: ")
    directions: dict[int, int] = {}
    try:
        if path.suffix.lower() in ENDINGS:
            points = points_of_nodes(data_sets(path, *POINTS, UNITS))
        else:
            # the header: names in order, since swapped axes would be read without a word, and unit
            points = {}
            head, *lines = path.read_text(encoding="utf-8-sig").splitlines() or [""]
            names = [cell.partition("[")[0].strip().lower() for cell in head.split(",")]
            if names[0].isdigit():
                raise ValueError("its first line holds numbers, not names of columns")
            if {"x", "y", "z"} <= set(names) and names[1:4] != ["x", "y", "z"]:
                raise ValueError(f"its columns are {', '.join(names)}")
            units = set(findall(r"\[(.*?)\]", head)) or {"m"}
            if len(units) > 1 or not units <= METRES.keys():
                raise ValueError(
                    f"its header has the units {', '.join(sorted(units))}, not m or mm"
                )
            metres = METRES[units.pop()]

            # a line for each node
            for n, line in enumerate(lines, 2):
                if not line.strip():
                    continue
                node, *cells = line.split(",")
                try:
                    number, place = int(node), np.array([float(cell) for cell in cells[:3]])
                except ValueError:
                    number, place = -1, np.zeros(0)
                if len(place) != 3 or len(cells) > 4:
                    raise ValueError(f"line {n} is not node, x, y, z: {line[:40]!r}")
                if not np.isfinite(place).all():
                    raise ValueError(f"line {n} has a point that is no number: {line[:40]!r}")
                if number in points:
                    raise ValueError(f"node {number} stands in two lines")
                points[number] = metres * place
                if len(cells) == 4 and cells[3].strip():
                    directions[number] = direction_named(cells[3])
        if not points:
            raise ValueError("it has no points")
    except (Unreadable, ValueError, KeyError, IndexError) as error:
        raise InvalidScene(
            f"--points {path} holds no points that can be read ({_why(error)}); give "
            "node, x, y, z in m below a header line (or mm, by x [mm]), or data set 15 or 2411."
        ) from None
    return points, directions


def write_hits(path: Path, hits: Hits) -> None:
    """Write as .mat, as `hammer` reads it."""
    from scipy.io import savemat

    savemat(path, {
        "dt": hits.dt, "force": hits.force.T, "response": hits.response.transpose(2, 1, 0),
        "points": [hits.points[i] for i in hits.point], "sensors": list(hits.sensors),
        "title": hits.title, "quantity": hits.quantity,
    }, do_compression=True)  # fmt: skip


def write_uff(path: Path, test: Responses) -> None:
    """Write as ASCII UFF58 (binary ones of this library cannot be read back)."""
    library = pyuff()
    file = library.UFF(str(path))
    for i in range(1, len(test.H) + 1):
        content = library.prepare_58(binary=0, **data_set(test, i))
        file.write_sets(content, mode="add" if i > 1 else "overwrite")


def write_modes(
    path: Path, test: MeasuredTest, frequency_hz: NDArray, zeta: NDArray, phi: NDArray
) -> None:
    """Write points, shapes phi (p, n) and responses as data sets 15, 55 and 58; shapes are the real
    parts of those turned to be as real as can be, along the directions of their points. Where some
    nodes have coordinates, shapes are written at these alone."""
    library = pyuff()

    # points without a node are numbered along z
    ends = [node_and_axis(name) or (i, 3) for i, name in enumerate(test.responses.points, 1)]
    numbers = sorted({node for node, _ in ends})
    sets = []
    if placed := [node for node in numbers if node in test.nodes]:
        numbers = placed
        x, y, z = np.array([test.nodes[node] for node in numbers]).T
        zero = [0] * len(numbers)
        sets.append(library.prepare_15(numbers, zero, zero, zero, list(x), list(y), list(z)))

    # a data set 55 for each shape: turned by half the phase of sum phi^2, which makes the sum of
    # squares of its real part as large as can be
    unused = {f"id{i}": "NONE" for i in range(2, 6)}
    for n, shape in enumerate(phi.T, start=1):
        turned = (shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real
        r = np.zeros((3, len(numbers)))
        for (node, axis), value in zip(ends, turned, strict=True):
            if node not in numbers:
                continue
            r[abs(axis) - 1, numbers.index(node)] = np.sign(axis) * value
        sets.append(
            library.prepare_55(
                id1=test.title[:80] or "NONE", model_type=1, analysis_type=2, data_ch=2,
                spec_data_type=8, data_type=2, n_data_per_node=3, node_nums=np.array(numbers),
                load_case=1, mode_n=n, freq=float(frequency_hz[n - 1]), modal_m=0,
                modal_damp_vis=float(zeta[n - 1]), modal_damp_his=0.0, r1=r[0], r2=r[1], r3=r[2],
                **unused,
            )
        )  # fmt: skip
    _write_sets(path, [*sets, *_response_sets(test.responses, test.title)])


def write_responses(
    path: Path, responses: FrequencyResponses, nodes: dict[int, NDArray[np.float64]], title: str
) -> None:
    """Write points (3,) [m] by number and the accelerations over N of all points to all references
    as data sets 15 and 58, as `[[measured]]` and `hammer` read them."""
    numbers = sorted(nodes)
    x, y, z = np.array([nodes[node] for node in numbers]).T
    zero = [0] * len(numbers)
    points = pyuff().prepare_15(numbers, zero, zero, zero, list(x), list(y), list(z))
    _write_sets(path, [points, *_response_sets(responses, title)])


def _response_sets(responses: FrequencyResponses, title: str) -> list[dict]:
    """Data sets 58 of all points to all references, in m/s^2 over N."""
    library, sets = pyuff(), []
    for i, point in enumerate(responses.points):
        for j, reference in enumerate(responses.references):
            at, hit = node_and_axis(point) or (i + 1, 3), node_and_axis(reference) or (j + 1, 3)
            sets.append(
                library.prepare_58(
                    binary=0, func_type=4, rsp_node=at[0], rsp_dir=at[1], ref_node=hit[0],
                    ref_dir=hit[1], data=responses.H[i, j], x=responses.frequency_hz,
                    id1=title[:80] or "NONE", rsp_ent_name=point[:10],
                    ref_ent_name=reference[:10], abscissa_spacing=1, abscissa_spec_data_type=18,
                    ordinate_spec_data_type=12, orddenom_spec_data_type=13,
                )
            )  # fmt: skip
    return sets


def _write_sets(path: Path, sets: list[dict]) -> None:
    """Write data sets one after another; the first replaces what is there."""
    file = pyuff().UFF(str(path))
    for i, one in enumerate(sets):
        file.write_sets(one, mode="add" if i else "overwrite")


def write_synthetic(file: OutputFile, test: Responses) -> None:
    """Write a computed test, .uff or .csv."""
    write = write_csv if file.path.suffix.lower() == ".csv" else write_uff
    with file.writing() as draft:
        write(draft, test)


def synthetic_file(path: Path, overwrite: bool) -> OutputFile:
    """File for a computed test; raises InvalidScene if it cannot be written."""
    if path.suffix.lower() not in (".csv", ".uff"):
        raise InvalidScene(
            f"{path} must end in .csv or .uff; hits at --points are written as .mat."
        )
    return OutputFile(path, "FILE", overwrite=overwrite)
