"""A chain at a reduced body in Exudyn (extra `verify`): its rigid spheres, its contact of exponent
3/2, its generic second-order body and its implicit trapezoidal rule.

The body's first coordinate is made the displacement at the contact, and tied to a sphere that the
last one touches: that sphere takes a small part of the body's own mass at the contact.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from beadwave import dem, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.workflows.evidence.harness import Comparison, compared, require_module
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import quiet

SOURCE = "Exudyn, ObjectGenericODE2 and ObjectContactSphereSphere, step 0.1 us"


def velocities(
    chain: dem.Chain, body: rom.ReducedModel, v0: NDArray[np.float64], *, duration: float,
    dt: float, n_save: int,
) -> NDArray[np.float64]:  # fmt: skip
    """(n_save, n) [m/s] of undamped Hertz spheres after each n_save-th of the duration.

    Raises ImportError without Exudyn, ValueError where its solver gives up.
    """
    import exudyn as exu
    from exudyn.itemInterface import (
        CoordinateConstraint,
        MarkerNodeCoordinate,
        MarkerNodeRigid,
        NodeGenericData,
        NodeGenericODE2,
        ObjectContactSphereSphere,
        ObjectGenericODE2,
        SensorNode,
    )

    container = exu.SystemContainer()
    system = container.AddSystem()
    n, R = chain.mass.size, float(chain.radius[0])

    # spheres along x, centres two radii of the first apart: contacts know only overlaps
    spheres = [
        _sphere(system, 2 * R * i, float(m), R, float(v))
        for i, (m, v) in enumerate(zip(chain.mass, v0, strict=True))
    ]

    # the reduced body in coordinates z, q = S z, whose first is u_w = w^T q: columns w / w^T w and
    # a basis of what w does not see
    S = np.column_stack([body.w / (body.w @ body.w), null_space(body.w[None])])
    M, K = S.T @ body.M @ S, S.T @ body.K @ S
    # 1e-3 of the body's mass at the contact, that the tied sphere takes
    tied_mass = 1e-3 * M[0, 0]
    M[0, 0] -= tied_mass
    zeros = [0.0] * len(M)
    modes = system.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=len(M), referenceCoordinates=zeros,
            initialCoordinates=zeros, initialCoordinates_t=zeros,
        )
    )  # fmt: skip
    system.AddObject(ObjectGenericODE2(nodeNumbers=[modes], massMatrix=M, stiffnessMatrix=K))

    # the sphere that the last one touches, tied to the body's first coordinate
    tied = _sphere(system, 2 * R * n, float(tied_mass), R, 0.0)
    ends = [
        system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
        for node in (modes, tied)
    ]
    system.AddObject(CoordinateConstraint(markerNumbers=ends))

    # contacts, F = A delta^(3/2)
    markers = [
        system.AddMarker(MarkerNodeRigid(nodeNumber=node)) for node in (*spheres, tied)
    ]  # fmt: skip
    for i, A in enumerate(chain.A):
        history = system.AddNode(
            NodeGenericData(numberOfDataCoordinates=4, initialCoordinates=[0.1, 0.0, 0.0, 0.0])
        )
        system.AddObject(
            ObjectContactSphereSphere(
                markerNumbers=markers[i : i + 2], nodeNumber=history, spheresRadii=[R, R],
                contactStiffness=float(A), contactStiffnessExponent=1.5,
            )
        )  # fmt: skip

    # the trapezoidal rule, with what Exudyn needs for contacts of exponent 3/2
    velocity = exu.OutputVariableType.Velocity
    sensors = [
        system.AddSensor(
            SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=velocity)
        )
        for node in spheres
    ]
    system.Assemble()

    settings = exu.SimulationSettings()
    time = settings.timeIntegration
    time.endTime, time.numberOfSteps = duration, n_save * int(np.ceil(duration / dt / n_save))
    time.verboseMode = 0
    time.newton.useModifiedNewton = True
    time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-8, 1e-12
    time.discontinuous.iterationTolerance = 1e3  # of opening contacts; tighter ones never end
    time.discontinuous.ignoreMaxIterations = True
    settings.solutionSettings.sensorsWritePeriod = duration / n_save
    settings.solutionSettings.writeSolutionToFile = False
    rule = exu.DynamicSolverType.TrapezoidalIndex2
    if not system.SolveDynamic(settings, solverType=rule):
        raise ValueError("Exudyn's solver gives up.")
    return np.column_stack([system.GetSensorStoredData(s)[1:, 1] for s in sensors])


def _sphere(system, x: float, mass: float, radius: float, speed: float):
    """The node of a rigid sphere at x [m] that moves along x."""
    from exudyn.itemInterface import NodeRigidBodyRxyz, ObjectRigidBody

    node = system.AddNode(
        NodeRigidBodyRxyz(
            referenceCoordinates=[x, 0, 0, 0, 0, 0], initialVelocities=[speed, 0, 0, 0, 0, 0]
        )
    )
    inertia = [0.4 * mass * radius**2] * 3 + [0.0] * 3
    system.AddObject(
        ObjectRigidBody(physicsMass=mass, physicsInertia=inertia, nodeNumber=node)
    )  # fmt: skip
    return node


def exudyn() -> Iterator[Comparison]:
    """The cantilever reduced to thirteen coordinates and its chain, marched by Exudyn."""
    require_module("exudyn")
    pipeline = pipeline_of(scene("cantilever", ("mesh.scale=2",)), quiet)
    model, start = pipeline("model"), pipeline("start")
    body = rom.free_modes(model.K, model.M, pipeline("contact").w, rom.Selection(n_modes=12))
    wall = wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf)
    run = {"duration": 1e-3, "n_save": 10}
    ours = dem.march_to_error(start.chain, wall, start.velocity, error=1e-7, **run).trajectory.v[1:]

    rough, fine = 4e-7, 1e-7  # steps [s]
    v_rough = velocities(start.chain, body, start.velocity, dt=rough, **run)
    v_fine = velocities(start.chain, body, start.velocity, dt=fine, **run)
    yield compared("cantilever and its chain: velocities [V]", ours, v_fine,
                   allowed=1e-4, of=float(np.abs(start.velocity).max()), source=SOURCE)  # fmt: skip

    # its implicit trapezoidal rule converges to our result with order 2
    errors = [float(np.abs(v - ours).max()) for v in (v_rough, v_fine)]
    order = np.log(errors[0] / errors[1]) / np.log(rough / fine)
    yield compared("cantilever and its chain: order of convergence to us", order, 2.0,
                   allowed=0.3, of=1.0, source=SOURCE)  # fmt: skip
