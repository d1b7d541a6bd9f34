"""A chain at a reduced body in Exudyn (extra `verify`): its rigid spheres, its contact of exponent
3/2, its generic second-order body and its implicit trapezoidal rule.

The body's first coordinate is made the displacement at the contact, and tied to a sphere that the
last one touches: that sphere takes a small part of the body's own mass at the contact.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from dem import Chain
from rom import ReducedModel

SHARE = 1e-3  # of the mass at the contact
DISCONTINUOUS = 1e3  # tolerance of its iterations on opening contacts; tighter ones never end


def velocities(
    chain: Chain, body: ReducedModel, v0: NDArray[np.float64], *, duration: float, dt: float,
    n_save: int,
) -> NDArray[np.float64]:  # fmt: skip
    """(n_save, n) [m/s] of undamped Hertz spheres after each n_save-th of the duration.

    Raises ImportError without Exudyn, ValueError where its solver gives up.
    """
    import exudyn as exu

    container = exu.SystemContainer()
    system = container.AddSystem()
    nodes = _spheres(exu, system, chain, v0)
    markers = [_marker(system, node) for node in nodes]
    markers.append(_wall(exu, system, body, chain))
    for i, A in enumerate(chain.A):
        _contact(exu, system, markers[i : i + 2], float(A), float(chain.radius[0]))
    kind = exu.OutputVariableType.Velocity
    sensors = [_sensor(system, node, kind) for node in nodes]
    system.Assemble()
    rule = exu.DynamicSolverType.TrapezoidalIndex2
    if not system.SolveDynamic(_settings(exu, duration, dt, n_save), solverType=rule):
        raise ValueError("Exudyn's solver gives up.")
    return np.column_stack([system.GetSensorStoredData(s)[1:, 1] for s in sensors])


def _spheres(exu, system, chain: Chain, v0: NDArray[np.float64]) -> list:
    """Rigid bodies along x, centres two radii of the first apart: contacts know only overlaps."""
    from exudyn.itemInterface import NodeRigidBodyRxyz, ObjectRigidBody

    R, found = float(chain.radius[0]), []
    for i, (m, v) in enumerate(zip(chain.mass, v0, strict=True)):
        at, speed = [2 * R * i, 0, 0, 0, 0, 0], [float(v), 0, 0, 0, 0, 0]
        node = system.AddNode(
            NodeRigidBodyRxyz(referenceCoordinates=at, initialVelocities=speed)
        )  # fmt: skip
        inertia = [0.4 * float(m) * R**2] * 3 + [0.0] * 3
        system.AddObject(
            ObjectRigidBody(physicsMass=float(m), physicsInertia=inertia, nodeNumber=node)
        )  # fmt: skip
        found.append(node)
    return found


def _marker(system, node):
    from exudyn.itemInterface import MarkerNodeRigid

    return system.AddMarker(MarkerNodeRigid(nodeNumber=node))


def _wall(exu, system, body: ReducedModel, chain: Chain):
    """The reduced body and the sphere that is tied to its contact; the marker of that sphere."""
    from exudyn.itemInterface import (
        CoordinateConstraint,
        MarkerNodeCoordinate,
        NodeGenericODE2,
        ObjectGenericODE2,
    )

    S = np.column_stack([body.w / (body.w @ body.w), null_space(body.w[None])])
    M, K = S.T @ body.M @ S, S.T @ body.K @ S
    own = SHARE * M[0, 0]
    M[0, 0] -= own
    nothing = [0.0] * len(M)
    states = {"referenceCoordinates": nothing, "initialCoordinates": nothing}
    modes = system.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=len(M), initialCoordinates_t=nothing, **states
        )
    )  # fmt: skip
    system.AddObject(ObjectGenericODE2(nodeNumbers=[modes], massMatrix=M, stiffnessMatrix=K))
    n, R = chain.mass.size, float(chain.radius[0])
    touched = chain._replace(mass=np.array([own]), radius=np.array([R]))
    (node,) = _spheres(exu, system, touched, np.zeros(1))
    system.SetNodeParameter(node, "referenceCoordinates", [2 * R * n, 0, 0, 0, 0, 0])
    ends = [
        system.AddMarker(MarkerNodeCoordinate(nodeNumber=one, coordinate=0))
        for one in (modes, node)
    ]
    system.AddObject(CoordinateConstraint(markerNumbers=ends))
    return _marker(system, node)


def _contact(exu, system, markers: list, A: float, R: float) -> None:
    from exudyn.itemInterface import NodeGenericData, ObjectContactSphereSphere

    data = system.AddNode(
        NodeGenericData(numberOfDataCoordinates=4, initialCoordinates=[0.1, 0.0, 0.0, 0.0])
    )
    system.AddObject(
        ObjectContactSphereSphere(
            markerNumbers=markers, nodeNumber=data, spheresRadii=[R, R], contactStiffness=A,
            contactStiffnessExponent=1.5,
        )
    )  # fmt: skip


def _sensor(system, node, kind):
    from exudyn.itemInterface import SensorNode

    return system.AddSensor(
        SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
    )


def _settings(exu, duration: float, dt: float, n_save: int):
    found = exu.SimulationSettings()
    time = found.timeIntegration
    time.endTime, time.numberOfSteps = duration, n_save * int(np.ceil(duration / dt / n_save))
    time.verboseMode = 0
    time.newton.useModifiedNewton = True
    time.discontinuous.iterationTolerance = DISCONTINUOUS
    time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-8, 1e-12
    time.discontinuous.ignoreMaxIterations = True
    found.solutionSettings.sensorsWritePeriod = duration / n_save
    found.solutionSettings.writeSolutionToFile = False
    return found
