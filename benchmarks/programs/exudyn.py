"""A chain at a reduced body in Exudyn (extra `verify`): its rigid spheres, its contact of exponent
3/2, its generic second-order body and its implicit trapezoidal rule.

The body's first coordinate is made the displacement at the contact, and tied to a sphere that the
last one touches: that sphere takes a small part of the body's own mass at the contact.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from beadwave import dem, rom


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
