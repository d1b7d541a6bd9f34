"""The last sphere across the chain as a stage, and what a run with friction says of it.

Only a scene with [friction] has these stages: they come after the march along the chain, which
friction leaves alone.
"""

from __future__ import annotations

import math
from contextlib import suppress
from operator import add
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.coupling.lateral_march import LateralSearch, WallMotion, march_lateral
from beadwave.coupling.periodic_state import PeriodicSearch
from beadwave.coupling.spatial_march import SpatialSearch
from beadwave.dem.friction import gross_slip, stick_stiffness, tangential_law
from beadwave.dem.lateral import LastSphere, LateralTrajectory
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.space import AcrossRun, RowRun
from beadwave.dem.spheres import hertz_overlap, mass
from beadwave.workflows.report.summary import ChainNumbers, FrictionNumbers
from beadwave.workflows.scene import RomWall, Scene
from beadwave.workflows.scene.tables.friction import arm_stiffness
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.chain import chain_numbers as of_chain
from beadwave.workflows.stages.chain.chain import Start, start
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine import compilation as of_impact

if TYPE_CHECKING:
    from beadwave.coupling.sensor_record import SensorRecord  # scipy's filters, a second
    from beadwave.dem.waves.chain_waves import ChainWaves

ARRIVED = 0.01  # of a wave's rise of force, at which it has reached the wall; not varied
ALL_STICKS = 0.999  # share of the area from which the contact sticks; not varied


def friction(
    scene: Scene, start: Start, wall: dem.Wall, impact: coupling.Impact
) -> LateralTrajectory:
    """The march across the chain, to the scene's error or at its step."""
    time = scene.time
    wanted = (
        {"error": time.error}
        if time.dt is None
        else {"search": LateralSearch(SpatialSearch(dt=time.dt))}
    )
    return march_lateral(
        start.chain,
        wall,
        start.velocity,
        impact.trajectory,
        last_sphere(scene, start),
        motion=wall_motion(scene),
        **wanted,
    )


BRIEF = LateralSearch(
    SpatialSearch(dt=1e-6),
    PeriodicSearch(
        cycle_steps=8, cycle_saves=8, levels=(), settling=1, most_iterations=1, directions=1,
        most_periods=2,
    ),
)  # fmt: skip


def compilation(scene: Scene) -> NDArray[np.float64]:
    """`compilation.compilation` of a scene with friction: also the kernels of the motion across,
    by a few steps of a motion in the same directions."""
    times = of_impact.compilation(scene)
    with suppress(ValueError):  # the run itself says what is wrong
        first, wall = start(scene), wall_of(scene)
        brief = dem.march(first.chain, wall, first.velocity, duration=5e-6, dt=1e-6, n_save=5)
        motion = wall_motion(scene)
        if motion is not None:
            motion = motion._replace(frequency=np.full(len(scene.shakers), 2e5))
        last = last_sphere(scene, first)
        march_lateral(
            first.chain, wall, first.velocity, brief, last, motion=motion,
            search=BRIEF,
        )  # fmt: skip
    return times


def wall_motion(scene: Scene) -> WallMotion | None:
    """The motion that the shakers give to the wall; None without any."""
    if not scene.shakers:
        return None
    return WallMotion(
        np.array([shaker.amplitude * shaker.vector[1:] for shaker in scene.shakers]),
        np.array([shaker.frequency for shaker in scene.shakers]),
        np.radians([shaker.phase for shaker in scene.shakers]),
    )


def shaker_forces(scene: Scene) -> ShakerForces:
    """Forces of the scene's shakers; of a given motion the force on its stinger."""
    shakers = scene.shakers or ()
    return ShakerForces(
        np.array([shaker.force_amplitude for shaker in shakers]),
        np.array([shaker.frequency for shaker in shakers]),
        np.radians([shaker.phase for shaker in shakers]),
    )


def last_sphere(scene: Scene, start: Start) -> LastSphere:
    """The last sphere of a scene, its friction and its arm across the chain."""
    chain, arm = scene.chain, scene.arm
    R, rho, E, nu = (
        float(np.atleast_1d(values)[-1])
        for values in (chain.radius, chain.density, chain.young, chain.poisson)
    )
    law = tangential_law(scene.friction.coefficient, R, E, nu, np.inf, *start.flat)
    before = None
    if scene.friction.between_spheres is not None:
        rubbed = (
            float(np.broadcast_to(values, chain.count)[-2])
            for values in (chain.radius, chain.young, chain.poisson)
        )
        before = tangential_law(scene.friction.between_spheres, R, E, nu, *rubbed)
    velocity = scene.striker.tangential_velocity if scene.striker else None
    inertia = 0.4 * float(mass(R, rho)) * R**2
    return LastSphere(
        law,
        inertia + (0.0 if arm is None else arm.inertia),
        np.zeros(2) if velocity is None else np.array(velocity, float),
        arm_stiffness(arm),
        0.0 if arm is None else arm.rotation,
        before,
    )


def numbers_across(
    scene: Scene,
    start: Start,
    run: dem.Trajectory | RowRun,
    lateral: LateralTrajectory | AcrossRun,
    dt: float,
    error: float | None,
) -> FrictionNumbers:
    """Stiffness and gross slip at the largest force, what the impact does across the chain, by a
    march of steps dt [s] with this error, and the periodic state before the striker."""
    law = last_sphere(scene, start).law
    force = float(run.contact_force[:, -1].max())
    overlap = float(hertz_overlap(force, start.chain.A[-1]))
    radius = float(np.sqrt(law.radius * overlap))

    # the contact point R n of the sphere moves by v_t + omega x R n, along t1 and t2 by
    # v_1 + R omega_2 and v_2 - R omega_1
    R = float(start.chain.radius[-1])
    spin = lateral.sphere_spin
    surface = lateral.sphere_t_v + R * np.stack([spin[:, 1], -spin[:, 0]], axis=1)
    speed = float(np.hypot(*surface[0]))
    ratio = float(surface[-1] @ surface[0]) / speed**2 if speed else None
    numbers = FrictionNumbers(
        stick_stiffness_N_m=float(stick_stiffness(law, radius)),
        gross_slip_m=float(gross_slip(law, overlap)),
        peak_friction_N=float(np.hypot(*lateral.friction_force.T).max()),
        velocity_m_s=tuple(map(float, lateral.sphere_t_v[-1])),
        spin_rad_s=tuple(map(float, spin[-1])),
        surface_velocity_ratio=ratio,
        dissipated_J=float(lateral.dissipated_friction[-1]),
        dt_s=dt,
        error_estimate=error,
    )
    if not lateral.cycle:
        return numbers
    return numbers.model_copy(update=cycle_numbers(scene, start, run, lateral))


def cycle_numbers(
    scene: Scene, start: Start, run: dem.Trajectory | RowRun, lateral: LateralTrajectory | AcrossRun
) -> dict[str, float | str | tuple[float, float] | None]:
    """Fields of `FrictionNumbers` of the periodic state, and of the instant at which a wave reaches
    the wall: when its force first differs from that at the start by a hundredth of its rise."""
    # the instant at which the wave is at the wall, and the state that it meets there
    cycle = lateral.cycle
    force = run.contact_force[:, -1]
    rise = np.abs(force - force[0])
    struck = bool(np.any(start.velocity)) and rise.max() > 0.0
    at = int((rise >= ARRIVED * rise.max()).argmax()) if struck else 0
    stick = float(lateral.stick_share[at])
    states = {"open": force[at] <= 0.0, "gross slip": stick == 0.0, "stick": stick > ALL_STICKS}
    shaker = scene.shakers[0]
    phase = (360.0 * shaker.frequency * float(run.t[at]) + shaker.phase) % 360.0
    return {
        "loop_energy_J": cycle.energy,
        "loop_energy_error_J": cycle.energy_error if math.isfinite(cycle.energy_error) else None,
        "loop_tangential_N": amplitude(cycle.friction_force[:, cycle.axis]),
        "loop_displacement_m": amplitude(cycle.slip[:, cycle.axis]),
        "loop_mean_tangential_range_N": cycle.mean_force_range,
        "loop_periods": cycle.periods,
        "loop_unbalanced_J": cycle.unbalanced,
        "periodicity_error": cycle.periodicity_error,
        "drift_m": cycle.drift,
        "state_at_impact": next((name for name, is_so in states.items() if is_so), "partial slip"),
        "stick_share_at_impact": stick,
        "phase_at_wall_deg": phase if struck else None,
    }


def amplitude(loop: NDArray[np.float64]) -> float:
    """Half of peak to peak of a period's samples (k,), the last like the first: the extrema are
    those of the parabolas through three samples, as these miss them by up to (pi/k)^2 / 2; of a
    force at its bound they are the bound."""
    y = loop[:-1]
    extrema = []
    for i in (int(y.argmax()), int(y.argmin())):
        before, after = y[i - 1], y[(i + 1) % y.size]
        bend = before - 2.0 * y[i] + after
        if np.sum(np.abs(y - y[i]) <= 1e-9 * abs(y[i])) > 2:
            bend = 0.0
        extrema.append(y[i] - ((after - before) ** 2 / (8.0 * bend) if bend else 0.0))
    return float(0.5 * (extrema[0] - extrema[1]))


def chain_numbers(
    scene: Scene,
    start: Start,
    wall: dem.Wall,
    impact: coupling.Impact,
    waves: ChainWaves,
    lateral: LateralTrajectory,
) -> ChainNumbers:
    """`chain_numbers.chain_numbers` of a scene with friction: errors of velocities and energy are
    those along the chain and across it together, or of the one march of both at a structure."""
    along = of_chain.chain_numbers(scene, start, wall, impact, waves)
    together = max if isinstance(scene.wall, RomWall) else add
    numbers = {
        "energy_error": together(along.numbers["energy_error"], lateral.energy_error),
        "friction": numbers_across(
            scene, start, impact.trajectory, lateral, lateral.dt, lateral.error_estimate
        ),
    }
    if not start.velocity.any():  # what moves spheres at rest is rounding
        numbers["waves"] = {}
    time_error = along.time_error
    if time_error is not None:
        time_error = together(time_error, lateral.error_estimate)
    return along._replace(
        numbers=along.numbers | numbers,
        warnings=(
            *along.warnings,
            *warnings.of_friction(scene, start, lateral),
        ),
        time_error=time_error,
    )


def chain_files(
    scene: Scene,
    impact: coupling.Impact,
    wall: dem.Wall,
    lateral: LateralTrajectory,
    record: SensorRecord | None = None,
) -> dict[str, bytes]:
    """`chain_numbers.chain_files`, trajectory.npz with the motion across the chain."""
    return of_chain.chain_files(scene, impact, wall, record, lateral=lateral)
