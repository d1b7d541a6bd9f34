"""Results of a run, as other programs read them: `summary.json`.

The named tuples are results of stages that a summary is put together from. They stand here, and not
with the stages that compute them, so that a run whose results are kept loads no march and no
finite elements to read them.
"""

from typing import Any, NamedTuple

from pydantic import AliasChoices, BaseModel, ConfigDict, Field

# with the names in folders that an earlier version wrote
ECHO_DELAY = AliasChoices("echo_delay_s", "tof_s")
ECHO_RATIO = AliasChoices("echo_ratio", "arr")


class StageTime(BaseModel):
    """Time of a stage in this run."""

    name: str
    seconds: float
    cached: bool


class WaveArrival(BaseModel):
    """A wave passing an observed sphere; `alone` if it was measured, not taken out of others.

    quality is 1 for a solitary wave and 0 for nothing like one: time and velocity then come from
    the wave's collisions at other spheres. Without a name it belongs to no wave that was followed
    through the chain, and has no quality. A wave that leaves its sphere moving, or is cut by the
    record, has no width.
    """

    time_s: float
    peak_velocity_m_s: float
    width_s: float | None = None
    quality: float | None = None
    name: str | None = None
    alone: bool = True


class SphereWaves(BaseModel):
    """Waves at one sphere; between the peaks of the incident and the first reflected one the time,
    and the ratio of their velocities. TOF and ARR, of the whole chain, are in `wall_contact`."""

    arrivals: tuple[WaveArrival, ...]
    echo_delay_s: float | None = Field(validation_alias=ECHO_DELAY)
    echo_ratio: float | None = Field(validation_alias=ECHO_RATIO)


class SensedArrival(BaseModel):
    """A wave in a sensor's signal: its crest, of a force-rate that of the force [V s], [N], of a
    displacement that of the velocity [V/s], [m/s]."""

    name: str
    time_s: float
    height: float


class SensorWaves(BaseModel):
    """A sensor's signal: its unit, largest value, waves; between the incident and the first
    reflected one the time, and the ratio of their heights."""

    unit: str
    largest: float
    arrivals: tuple[SensedArrival, ...]
    echo_delay_s: float | None = Field(validation_alias=ECHO_DELAY)
    echo_ratio: float | None = Field(validation_alias=ECHO_RATIO)


class TrackedWave(BaseModel):
    """A wave from one contact to another; contact i is that of the spheres i and i + 1."""

    name: str
    from_contact: int
    to_contact: int
    start_s: float
    end_s: float
    speed_m_s: float
    peak_force_N: float


class ChainContact(BaseModel):
    """The chain's impact at its wall, in the thesis' numbers (2.5) to (2.9); see dem.WallContact.

    The contact lasts while its force is above threshold_N, 1 % of the largest above that at rest.
    The last two are of the whole record: spheres' velocities and kinetic energy, end over start.
    """

    contact_time_s: float | None
    threshold_N: float
    tau_c: float | None
    speed_in_m_s: float | None
    speed_back_m_s: float | None
    travelling_time_s: float | None
    tof_s: float | None
    arr_2_9: float | None
    velocity_sum_ratio_2_8: float | None
    energy_restitution: float | None
    trains: tuple[TrackedWave, ...]


class NumberError(BaseModel):
    """A number of the summary with its errors by cause, in its unit; None where one is not known.

    name: its key, of a wave "sphere: wave: key", of a mode "mode i"; total is the sum of those
    that are known.
    """

    name: str
    value: float
    unit: str
    time: float | None = None
    reduction: float | None = None
    mesh: float | None = None
    theory: float | None = None  # of a beam or a plate
    receptance: float | None = None  # of a measured wall, or of measured parts
    total: float | None = None
    why: str = ""  # where the mesh's error comes from if it is large, and what helps

    @property
    def relative(self) -> float | None:
        """The whole error over the value; None where one is not known, or the value is zero."""
        if self.total is None or not self.value:
            return None
        return self.total / abs(self.value)


class ChainNumbers(NamedTuple):
    """The chain and its wall in the summary."""

    numbers: dict[str, Any]  # fields of the summary by name
    warnings: tuple[str, ...]
    time_error: float | None  # of the march: relative, of the observed velocities
    coupled: bool  # the wall is read elsewhere than it is pushed, and has no error of its model


class StructureNumbers(NamedTuple):
    """The assembly and its reduced model in the summary."""

    numbers: dict[str, Any]  # fields of the summary by name
    warnings: tuple[str, ...]


class FrictionNumbers(BaseModel):
    """The last sphere across the chain, under friction at the wall; vectors along t1 and t2.

    The first two are of the contact at its peak force; surface_velocity_ratio: velocity of the
    sphere's surface at the contact, end over start, None where it starts at rest; dt_s and
    error_estimate: step of the march across, and its error relative to the largest speed at the
    start, the periodic state's included. Where shakers move the wall: loop before the striker, its
    energy in a period of the wall and its amplitudes (half of peak to peak), least and largest mean
    force over the periodic states of contacts that were pushed beforehand, periods until the loop
    repeats itself, of a structure by how much the shakers' work and all losses of a period differ,
    how far the force is from periodic and how far the sphere drifts in a loop; what
    the contact does when the wave reaches it ("stick", "partial slip",
    "gross slip", "open"; at the start where nothing strikes), and the first shaker's phase then.
    loop_mean_tangential_range_N: of the cycles that contacts come into which were never sheared, or
    pushed to either side before; None where those are not known.
    """

    stick_stiffness_N_m: float
    gross_slip_m: float
    peak_friction_N: float
    velocity_m_s: tuple[float, float]
    spin_rad_s: tuple[float, float]
    surface_velocity_ratio: float | None = None
    dissipated_J: float
    dt_s: float
    error_estimate: float | None
    loop_energy_J: float | None = None
    loop_energy_error_J: float | None = None
    loop_tangential_N: float | None = None
    loop_displacement_m: float | None = None
    loop_mean_tangential_range_N: tuple[float, float] | None = None
    loop_periods: int | None = None
    loop_unbalanced_J: float | None = None
    periodicity_error: float | None = None
    drift_m: float | None = None
    state_at_impact: str | None = None
    stick_share_at_impact: float | None = None
    phase_at_wall_deg: float | None = None


class CrystalNumbers(BaseModel):
    """A packing of spheres in space and the front that runs through it.

    front_speed_m_s: along x, y and z, None where too few spheres lie in line with the struck ones;
    band_edges_hz: least and largest frequency of each band of the pressed lattice in turn, None
    where nothing presses; peak_structure_force_N: of the whole last row on what is behind it.
    """

    n_spheres: int
    n_contacts: int
    front_speed_m_s: dict[str, float | None]
    band_edges_hz: tuple[float, ...] | None = None
    peak_structure_force_N: float | None = None


class ChainOnStructureNumbers(BaseModel):
    """One of several chains on a structure; errors: relative, of the velocities of its spheres."""

    peak_wall_force_N: float
    contact_radius_m: float  # of the Hertz contact at that force
    waves: dict[str, SphereWaves] = {}
    wall_contact: ChainContact | None = None
    friction: FrictionNumbers | None = None
    errors: "ErrorEstimate"
    sphere_errors_m_s: tuple[float, ...] = ()  # (n,) of each velocity by the time step


class ErrorEstimate(BaseModel):
    """Relative errors of the observed velocities by cause; None where nothing estimates one."""

    time: float | None = None
    reduction: float | None = None
    mesh: float | None = None
    theory: float | None = None  # of a beam or a plate, against three-dimensional elasticity
    receptance: float | None = None  # of a measured wall: noise and end of its band


class ReductionHealth(BaseModel):
    """The reduced model in numbers; see rom.Health.

    effective_mass_captured: effective mass of the modes along the chain over the assembly's;
    half_space_compliance_m_per_N: contained in the Hertz law, and subtracted from the wall;
    mass_kg, centre_m: of all parts, from the mass matrix; grounding: rigid-body residual forces
    relative to the stiffness, rounding; fixed_interface_hz: the lowest ones;
    receptance_error: relative, rms, of the receptance with receptance_loss_factor.
    """

    kind: str
    coordinates: int
    static_compliance_m_per_N: float
    half_space_compliance_m_per_N: float
    effective_mass_captured: float | None = None
    mass_kg: float | None = None
    centre_m: tuple[float, ...] = ()
    grounding: float | None = None
    fixed_interface_hz: tuple[float, ...] = ()
    asymmetry: float
    lowest_mass: float
    lowest_stiffness: float
    rigid_modes: int
    moved_by_the_contact: float
    receptance_error: float | None = None
    receptance_loss_factor: float | None = None
    findings: tuple[str, ...] = ()


class ModeFound(BaseModel):
    """A computed mode, and the target that it is, if it is one.

    participation at the contact [kg^-1/2]; effective_mass: shares of the whole mass along x, y, z;
    score: share of the mode's energy in the motion by which the target is recognised; mac: with
    that mode of stiff joints, where `modes` or `tune` has computed it before.
    """

    number: int
    frequency_hz: float
    participation: float | None = None
    effective_mass: tuple[float, float, float]
    target: int | None = None
    target_hz: float | None = None
    shape: str | None = None
    score: float | None = None
    mac: float | None = None


class ContactRow(BaseModel):
    """The faces that the bolts of a joint press."""

    joint: str
    zone_area_m2: float
    zone_radius_m: float  # mean over the bolts, of a disc with the hole
    pressure_max_Pa: float
    force_N: float
    stuck_share: float
    pressure_error: float  # relative
    zone_error: float  # relative, of the area
    # zone and frequencies change with the preload, of faces that are rough or do not fit each other
    follows_preload: bool = False


class ModeAtAmplitude(BaseModel):
    """A mode at its largest amplitude of a run, which the run gives it, and at the run's end, of
    faces in contact under preload. Displacements are of the point that moves most."""

    mode: int
    linear_hz: float
    displacement_m: float
    frequency_hz: float
    loss_factor: float  # of the friction alone
    end_displacement_m: float
    end_frequency_hz: float
    end_loss_factor: float


class SolvedMeshNumbers(BaseModel):
    """A mesh of the search for sizes of elements."""

    unknowns: int
    elements: int
    stated: float  # largest relative error
    seconds: float


class LeftOutNumbers(BaseModel):
    """A feature that mesh.simplify leaves out of the mesh."""

    body: str
    faces: tuple[str, ...]  # "body@x,y,z" [m]
    size_m: float  # diameter of a hole, radius of a rounding, diagonal of other faces
    error: float  # relative, of what it changes most; a part of the stated one


class MeshNumbers(BaseModel):
    """The mesh that follows from mesh.error, and those before it."""

    asked: float  # relative error
    stated: float
    # of the stated error, which no mesh lowers: dents under springs, features that are left out
    floor: float
    # apart from the stated error: the largest relative difference of the volumes of a body and its
    # mesh, whose elements cut curved faces short
    chords: float = 0.0
    # what kept it above the one asked: unknowns, floor, singular (errors fall too slowly), meshes,
    # sizes (of another scene)
    bounded_by: str | None = None
    unknowns_for_asked: float | None = None  # foreseen
    seconds_for_asked: float | None = None
    where: str = ""  # the place of most of the error
    meshes: tuple[SolvedMeshNumbers, ...] = ()
    left_out: tuple[LeftOutNumbers, ...] = ()


class ValueSource(BaseModel):
    """Origin of a value of the scene: thesis, inferred, assumed, yours, chosen, default."""

    kind: str
    note: str = ""


class Summary(BaseModel):
    """Every number of a run that is worth comparing."""

    model_config = ConfigDict(ser_json_inf_nan="null", frozen=True)

    scene: str
    command: str = ""
    date: str = ""
    modes_hz: dict[str, float] = {}
    modes: tuple[ModeFound, ...] = ()
    dofs: int = 0
    load_factor: float | None = None  # static load over that which buckles the structure
    mesh: MeshNumbers | None = None  # of mesh.error
    contact: tuple[ContactRow, ...] = ()  # faces that bolts press
    amplitudes: tuple[ModeAtAmplitude, ...] = ()  # of faces in contact
    n_wall_modes: int = 0
    dt_s: float | None = None
    n_steps: int = 0
    peak_wall_force_N: float | None = None
    contact_radius_m: float | None = None
    energy_error: float | None = None
    error_estimate: ErrorEstimate = ErrorEstimate()
    error_spheres: tuple[int, ...] = ()  # whose velocities error_estimate is of
    sphere_errors_m_s: tuple[float, ...] = ()  # (n,) of each velocity by the time step
    errors: tuple[NumberError, ...] = ()
    waves: dict[str, SphereWaves] = {}
    sensors: dict[str, SensorWaves] = {}
    wall_contact: ChainContact | None = None
    friction: FrictionNumbers | None = None
    crystal: CrystalNumbers | None = None
    chains: dict[str, ChainOnStructureNumbers] = {}  # by name
    reduction: ReductionHealth | None = None
    verdict: tuple[str, ...] = ()
    seconds: float | None = None  # of the whole run; stages of two processes overlap
    stages: tuple[StageTime, ...] = ()
    warnings: tuple[str, ...] = ()
    synthetic: tuple[str, ...] = ()  # measured parts whose receptances were computed
    versions: dict[str, str] = {}
    sources: dict[str, ValueSource] = {}

    def error(self, name: str) -> float | None:
        """The whole error of a number by its name in `errors`, in its unit."""
        return next((e.total for e in self.errors if e.name == name), None)

    def relative_error(self, name: str) -> float | None:
        """Error over the number's value."""
        return next((e.relative for e in self.errors if e.name == name), None)

    def text(self) -> str:
        """JSON, indented."""
        return self.model_dump_json(indent=2) + "\n"
