"""Rows of a summary for the terminal and the page: label, value with unit, meaning."""

from beadwave.workflows.report.number_format import GLUE, NONE, digits, grouped, percent, si
from beadwave.workflows.report.stage_words import stage_words
from beadwave.workflows.report.summary import (
    ContactRow,
    CrystalNumbers,
    FrictionNumbers,
    MeshNumbers,
    ModeAtAmplitude,
    ReductionHealth,
    SensorWaves,
    SphereWaves,
    Summary,
)

# each error of a run: its field of the summary's estimate, the stages whose seconds it pays for
ERRORS = {
    "time step": ("time", ("impact", "wall", "compilation")),
    "reduction": (
        "reduction",
        ("reduction", "reduction-error", "full-response", "response", "modes", "contact"),
    ),
    "mesh": (
        "mesh",
        (
            "search",
            "mesh",
            "model",
            "second-mesh",
            "missed-energy",
            "quantity-errors",
            "mesh-error",
            "structure-errors",
        ),
    ),
    "theory": ("theory", ("other-theories", "theory-error")),
    "receptance": ("receptance", ("receptance-error",)),
}
SQUARED = "\N{SUPERSCRIPT TWO}"
NO_LOSS = 1e-6  # a loss factor of friction that is none
LARGE = 0.05  # relative error from which on it stands out
MIN_CHORDS = 1e-5  # relative difference of volumes that is worth words
# rows with an error of their own: the name of their number in the summary's table of errors
ERROR_OF = {
    "time of flight TOF": "tof_s",
    "amplitude ratio ARR": "arr_2_9",
    "peak force at the wall": "peak_wall_force_N",
    "contact time": "contact_time_s",
    "static compliance of the structure": "static_compliance_m_per_N",
}

NAMES = {name: label for label, name in ERROR_OF.items()}
WAVE_NAMES = {": time_s": ", time", ": peak_velocity_m_s": ", peak velocity"}


def headline(summary: Summary) -> list[tuple[str, str]]:
    """The main results: frequencies, arrivals, TOF, ARR, errors, seconds."""
    return results(summary) + errors_and_seconds(summary)


def results(summary: Summary) -> list[tuple[str, str]]:
    """Of the headline what is known before errors are: frequencies, arrivals, TOF, ARR."""
    rows = [("scene", summary.scene)]
    if summary.modes_hz:
        rows.append(("measured modes, computed", measured_modes(summary)))
    if summary.load_factor is not None:
        rows.append(("load over buckling load", percent(summary.load_factor)))
    if summary.mesh:
        rows.append(("mesh", mesh_words(summary.mesh)))
    rows += [
        (f"waves at sphere {s}", arrivals(waves, summary, s)) for s, waves in summary.waves.items()
    ]
    rows += [(name, sensed(signal)) for name, signal in summary.sensors.items()]
    rows += [(f"contact of {row.joint}", zone(row)) for row in summary.contact]
    rows += [
        (f"mode {mode.mode} at its amplitude", at_amplitude(mode))
        for mode in summary.amplitudes
        if mode.loss_factor > NO_LOSS
    ]
    if contact := summary.wall_contact:
        of_wall = {
            "time of flight TOF": si(contact.tof_s, "s"),
            "amplitude ratio ARR": percent(contact.arr_2_9),
            "peak force at the wall": si(summary.peak_wall_force_N, "N"),
        }
        rows += [(label, with_error(summary, ERROR_OF[label], x)) for label, x in of_wall.items()]
    if crystal := summary.crystal:
        rows += crystal_rows(crystal)
    rows += chains_rows(summary)
    if across := summary.friction:
        back = across.surface_velocity_ratio
        rows += [
            ("velocity across, t1 and t2", listed([si(x, "m/s") for x in across.velocity_m_s])),
            ("spin about t1 and t2", listed([si(x, "rad/s") for x in across.spin_rad_s])),
            (
                "velocity at contact, end over start",
                NONE if back is None else digits(back, 4),
            ),
            ("heat of friction", si(across.dissipated_J, "J")),
            ("loop of a period", friction_loop(across)),
            ("contact when the wave comes", contact_state(across)),
        ]
    return [(label, value) for label, value in rows if value not in ("", NONE)]


def chains_rows(summary: Summary) -> list[tuple[str, str]]:
    """Several chains: the waves at their spheres, and what each says of the structure."""
    rows = []
    for name, chain in summary.chains.items():
        rows += [
            (f"{name}, waves at sphere {s}", arrivals(waves, summary, s))
            for s, waves in chain.waves.items()
        ]
        contact = chain.wall_contact
        parts = [f"peak {si(chain.peak_wall_force_N, 'N')}"]
        if contact is not None and contact.tof_s is not None:
            parts.append(f"TOF {si(contact.tof_s, 's')}")
        if contact is not None and contact.arr_2_9 is not None:
            parts.append(f"ARR {percent(contact.arr_2_9)}")
        rows.append((f"{name}, at the structure", listed(parts)))
        if across := chain.friction:
            heat = f"heat {si(across.dissipated_J, 'J')}"
            parts = [f"peak {si(across.peak_friction_N, 'N')}", heat]
            rows.append((f"{name}, friction", listed(parts)))
    return rows


def crystal_rows(crystal: CrystalNumbers) -> list[tuple[str, str]]:
    """Spheres in space: how many, how fast the front runs, with what force it arrives."""
    speeds = [
        f"{axis} {si(speed, 'm/s')}"
        for axis, speed in crystal.front_speed_m_s.items()
        if speed is not None
    ]
    counts = (f"{grouped(crystal.n_spheres)} spheres", f"{grouped(crystal.n_contacts)} contacts")
    return [
        ("crystal", listed([*counts])),
        ("speed of the front", listed(speeds)),
        ("peak force on the wall", si(crystal.peak_structure_force_N, "N")),
        ("bands of small waves", bands(crystal.band_edges_hz or ())),
    ]


def bands(edges: tuple[float, ...]) -> str:
    """Bands by their edges [Hz], lower and upper in turn."""
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return listed([f"{si(low, 'Hz') if low else '0'} to {si(high, 'Hz')}" for low, high in pairs])


def zone(row: ContactRow) -> str:
    """Zone and pressure of the faces that the bolts of a joint press."""
    return (
        f"{digits(1e6 * row.zone_area_m2, 4)} mm{SQUARED} ± "
        f"{percent(row.zone_error, 2)}, {percent(row.stuck_share, 2)} sticks; "
        f"up to {si(row.pressure_max_Pa, 'Pa')} ± {percent(row.pressure_error, 2)}"
    )


def at_amplitude(mode: ModeAtAmplitude) -> str:
    """Frequency and loss factor that a run gives a mode, and what they come to by its end."""
    words = [
        f"{digits(hz, 6)} Hz, loss factor {digits(loss, 2)} at {si(x, 'm')}"
        for hz, loss, x in (
            (mode.frequency_hz, mode.loss_factor, mode.displacement_m),
            (mode.end_frequency_hz, mode.end_loss_factor, mode.end_displacement_m),
        )
    ]
    return f"{words[0]}; in the end {words[1]}"


def mesh_words(mesh: MeshNumbers) -> str:
    """Unknowns and errors of the meshes that mesh.error led to."""
    each = [
        f"{grouped(m.unknowns)} unknowns ±{GLUE}{percent(m.stated, 2)} in {si(m.seconds, 's')}"
        for m in mesh.meshes
    ]
    asked = f"{', '.join(each)}; asked ±{GLUE}{percent(mesh.asked, 2)}"
    if mesh.left_out:
        most = max(mesh.left_out, key=lambda part: part.error)
        asked += (
            f"; {len(mesh.left_out)} small features left out, most of it at {most.faces[0]} "
            f"±{GLUE}{percent(most.error, 2)}"
        )
    if mesh.chords < MIN_CHORDS:
        return asked
    return f"{asked}; volumes within {percent(mesh.chords, 2)} of those of curved bodies"


def with_error(summary: Summary, name: str, text: str) -> str:
    """A value's text with its relative error, where one is known: 607 N +- 0.3 %."""
    relative = summary.relative_error(name)
    return text if relative is None else f"{text}{GLUE}{error_words(relative)}"


def error_words(relative: float) -> str:
    """A relative error next to its number, a large one with an exclamation mark."""
    return f"±{GLUE}{percent(relative, 2)}{'!' if relative > LARGE else ''}"


def errors_and_seconds(summary: Summary) -> list[tuple[str, str]]:
    """Of the headline what comes last."""
    # relative errors of the observed velocities, and how far the energy balance is from closing
    errors = []
    for label, (name, _) in ERRORS.items():
        value = getattr(summary.error_estimate, name)
        if value is not None:
            errors.append(f"{label} {percent(value, 2)}")
    text = listed(errors)
    if errors and summary.error_spheres:
        text += f" (velocities of {spheres_words(summary)})"
    if summary.energy_error is not None:
        balance = listed([f"energy balance {percent(summary.energy_error, 2)}"])
        text += f", {balance}" if text else balance
    rows = [("errors", text)]

    # seconds of the run, and of the three longest stages
    spent = {stage.name: stage.seconds for stage in summary.stages if not stage.cached}
    if sum(spent.values()) < 0.01:
        seconds = "kept results"
    else:
        longest = sorted(spent, key=spent.get, reverse=True)[:3]
        stages = [
            f"{stage_words(name)} {digits(spent[name])}" for name in longest if spent[name] >= 0.05
        ]
        seconds = digits(run_seconds(summary)) + (f" ({', '.join(stages)})" if stages else "")
    rows.append(("seconds", seconds))
    return [(label, value) for label, value in rows if value not in ("", NONE)]


def spheres_words(summary: Summary) -> str:
    """The spheres whose velocities the errors of a run are of."""
    spheres = summary.error_spheres
    if len(spheres) > 2 and len(spheres) == len(summary.sphere_errors_m_s):
        return "all spheres"
    return f"sphere{'s' if len(spheres) > 1 else ''} {', '.join(map(str, spheres))}"


def listed(parts: list[str]) -> str:
    """Parts between commas; lines break between them only."""
    return ", ".join(part.replace(" ", GLUE) for part in parts)


def measured_modes(summary: Summary) -> str:
    """Frequencies [Hz] of the modes that are targets."""
    return f"{' / '.join(digits(f, 4) for f in summary.modes_hz.values())} Hz"


def arrivals(waves: SphereWaves, summary: Summary, sphere: str) -> str:
    """Times and peak velocities of the waves that pass a sphere, with their errors."""
    passing = []
    for wave in waves.arrivals:
        # a chain too short for tracks: waves by their time alone
        name, key = wave.name or "at", f"{sphere}: {wave.name or 'unnamed'}"
        time = with_error(summary, f"{key}: time_s", si(wave.time_s, "s"))
        velocity = si(wave.peak_velocity_m_s, "m/s")
        velocity = with_error(summary, f"{key}: peak_velocity_m_s", velocity)
        # a line may break before the velocity: with errors both are too long for one
        passing.append(f"{name} {time}".replace(" ", GLUE) + " " + listed([f"({velocity})"]))
    return ", ".join(passing) or "none"


def sensed(signal: SensorWaves) -> str:
    """Largest value and waves of a sensor's signal, in a line."""
    parts = [f"up to {si(signal.largest, signal.unit)}"]
    if signal.echo_delay_s is not None:
        delay, ratio = si(signal.echo_delay_s, "s"), percent(signal.echo_ratio)
        parts += [f"echo delay {delay}", f"echo ratio {ratio}"]
    return listed(parts)


def run_seconds(summary: Summary) -> float:
    """Seconds of a run; of a folder that an earlier version wrote, the sum of its stages."""
    computed = sum(stage.seconds for stage in summary.stages if not stage.cached)
    return computed if summary.seconds is None or computed < 0.01 else summary.seconds


def details(summary: Summary) -> list[tuple[str, str]]:
    """All rows that are not in the headline."""
    rows = [
        ("degrees of freedom", grouped(summary.dofs) if summary.dofs else ""),
        ("wall modes", str(summary.n_wall_modes) if summary.n_steps else ""),
        ("time step", si(summary.dt_s, "s")),
        ("steps", grouped(summary.n_steps) if summary.n_steps else ""),
    ]
    rows += [(label, value) for label, value, _ in at_wall(summary)]
    rows += friction_rows(summary.friction) if summary.friction else []
    rows += reduction_rows(summary.reduction) if summary.reduction else []
    rows = [(label, with_error(summary, ERROR_OF.get(label, ""), value)) for label, value in rows]
    left_out = {label for label, _ in headline(summary)} | {"", NONE}
    return [row for row in rows if not left_out & set(row)]


def left_out(summary: Summary) -> list[tuple[str, str]]:
    """Numbers that the headline leaves out, and the options that print them."""
    groups = [
        *(["contact, wave speeds, restitution"] if summary.wall_contact else []),
        *(["reduced model"] if summary.reduction else []),
        "seconds of each stage",
    ]
    rows = [("more by --verbose", listed(groups))]
    if any(error.unit == "Hz" for error in summary.errors):
        rows.append(("by beadwave modes", listed(["error of each frequency", "MAC"])))
    return rows


def at_wall(summary: Summary) -> list[tuple[str, str, str]]:
    """The collision with the wall, by the quantities of the literature: label, value, meaning."""
    c = summary.wall_contact
    if c is None:
        return []
    rows = [
        ("peak force at the wall", si(summary.peak_wall_force_N, "N"), "of the last contact"),
        ("contact radius", si(summary.contact_radius_m, "m"), "of the Hertz contact at that force"),
        (
            "contact time",
            si(c.contact_time_s, "s"),
            f"while the force is above {si(c.threshold_N, 'N')}, 1 % of its peak above rest",
        ),
        (
            "dimensionless contact time τ_c",
            si(c.tau_c, ""),
            "contact time over (m² / (V A_w²))^(1/5): mass of the last sphere, speed of the "
            "striker, Hertz coefficient at the wall",
        ),
        ("wave speed, incident", si(c.speed_in_m_s, "m/s"), "mean along the chain"),
        ("wave speed, reflected", si(c.speed_back_m_s, "m/s"), "of the first reflected wave"),
        (
            "travelling time",
            si(c.travelling_time_s, "s"),
            "through all spheres and back at these two speeds",
        ),
        ("time of flight TOF", si(c.tof_s, "s"), "travelling time and contact time"),
        (
            "amplitude ratio ARR",
            percent(c.arr_2_9),
            "|reflected / incident velocity|^(6/5), mean along the chain: the ratio of the forces",
        ),
        (
            "energy restitution",
            percent(c.energy_restitution),
            "square root of kinetic energy at the end over that at the start",
        ),
        (
            "velocity sum ratio",
            percent(c.velocity_sum_ratio_2_8),
            "sum of sphere speeds, end over start; no measure of loss: elastic spheres at a rigid "
            "wall reach 136 %",
        ),
    ]
    return [row for row in rows if row[1] != NONE]


def budget(summary: Summary) -> list[tuple[str, str, str]]:
    """Each error with the seconds of the stages that it pays for."""
    spent = {stage.name: stage.seconds for stage in summary.stages if not stage.cached}
    rows, paid = [], set()
    for label, (name, stages) in ERRORS.items():
        error = getattr(summary.error_estimate, name)
        stages = [stage for stage in stages if stage in spent]
        paid |= set(stages)
        seconds = digits(sum(spent[stage] for stage in stages)) if stages else ""
        if error is not None or stages:
            rows.append((label, percent(error, 2), seconds))
    if summary.energy_error is not None:
        rows.append(("energy balance", percent(summary.energy_error, 2), ""))
    other_seconds = sum(seconds for name, seconds in spent.items() if name not in paid)
    if other_seconds:
        rows.append(("everything else", "", digits(other_seconds)))
    return rows


def friction_loop(across: FrictionNumbers) -> str:
    """Energy and amplitudes of a period before the striker; none of a wall at rest."""
    if across.loop_energy_J is None:
        return ""
    amplitudes = (si(across.loop_tangential_N, "N"), si(across.loop_displacement_m, "m"))
    return listed([si(across.loop_energy_J, "J"), *(f"±{GLUE}{x}" for x in amplitudes)])


def contact_state(across: FrictionNumbers) -> str:
    """State of the contact when the wave arrives, and the first shaker's phase then."""
    if across.state_at_impact is None or across.phase_at_wall_deg is None:
        return ""
    parts = [across.state_at_impact, f"{percent(across.stick_share_at_impact)} of the area sticks"]
    return listed([*parts, f"at {digits(across.phase_at_wall_deg)}°"])


def friction_rows(across: FrictionNumbers) -> list[tuple[str, str]]:
    """The contact at the wall across the chain."""
    return [
        ("tangential stiffness, all sticks", si(across.stick_stiffness_N_m, "N/m")),
        ("displacement at gross slip", si(across.gross_slip_m, "m")),
        ("peak force of friction", si(across.peak_friction_N, "N")),
        ("mean force of a loop", mean_force(across)),
        ("periods of a loop", "" if across.loop_periods in (None, 1) else str(across.loop_periods)),
        ("error of a loop's energy", si(across.loop_energy_error_J, "J")),
        ("work less losses of a loop", si(across.loop_unbalanced_J, "J")),
        ("time step across the chain", si(across.dt_s, "s")),
    ]


def mean_force(across: FrictionNumbers) -> str:
    """Range over the periodic states of other starts; none where all starts lead to one."""
    if across.loop_mean_tangential_range_N is None:
        return ""
    least, largest = across.loop_mean_tangential_range_N
    spread = largest - least > 1e-3 * (across.loop_tangential_N or 0.0)
    return f"{si(least, 'N')} to {si(largest, 'N')}, by its start" if spread else ""


def reduction_rows(health: ReductionHealth) -> list[tuple[str, str]]:
    """The reduced model in numbers."""
    compliance = health.static_compliance_m_per_N
    receptance_error = percent(health.receptance_error, 2)
    if health.receptance_loss_factor:
        receptance_error += f" at a loss factor of {percent(health.receptance_loss_factor)}"
    lowest = ", ".join(si(f, "Hz", 4) for f in health.fixed_interface_hz)
    rows = [
        ("kind", f"{health.kind}, {health.coordinates} coordinates"),
        (
            "static compliance of the structure",
            si(compliance - health.half_space_compliance_m_per_N, "m/N"),
        ),
        ("with the half-space under the patch", si(compliance, "m/N")),
        ("mass", si(health.mass_kg, "kg", 4)),
        ("centre of mass x, y, z", ", ".join(si(x, "m") for x in health.centre_m)),
        ("lowest fixed-interface frequencies", lowest),
        ("effective mass along the chain", percent(health.effective_mass_captured)),
        ("share of modes excited at the contact", percent(health.moved_by_the_contact)),
        ("rigid-body residual forces", percent(health.grounding, 2)),
        ("matrix asymmetry", percent(health.asymmetry, 2)),
        ("receptance error (rms)", receptance_error),
    ]
    return [(label, value) for label, value in rows if value not in (NONE, "")]


def spelled(name: str) -> str:
    """The words for a number that `errors` of a summary names."""
    for key, words in WAVE_NAMES.items():
        if name.endswith(key):
            return f"sphere {name.removesuffix(key)}{words}"
    return NAMES.get(name, name)
