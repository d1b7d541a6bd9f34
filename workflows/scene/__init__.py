"""The scene of a run: tables of keys, read from TOML, checked before anything is computed."""

from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import InvalidScene, Positive, SceneTable, nearest
from beadwave.workflows.scene.tables.chain import LeafSpringsTable, Preload
from beadwave.workflows.scene.tables.contact import ContactTable
from beadwave.workflows.scene.tables.damping import (
    Damping,
    LossFactorsTable,
    ModalDampingTable,
    NoDamping,
    RayleighDampingTable,
)
from beadwave.workflows.scene.tables.joints import Joints, JointStiffnesses
from beadwave.workflows.scene.tables.mesh import Mesh
from beadwave.workflows.scene.tables.reduction import Patch, Reduction
from beadwave.workflows.scene.tables.sensors import Instrument, Output, SensorTable
from beadwave.workflows.scene.tables.time import Time
from beadwave.workflows.scene.tables.walls import (
    DashpotWall,
    HalfSpaceWall,
    MeasuredWall,
    OneDofWall,
    RigidWall,
    RomWall,
)

__all__ = [
    "ContactTable",
    "Damping",
    "DashpotWall",
    "HalfSpaceWall",
    "Instrument",
    "InvalidScene",
    "JointStiffnesses",
    "Joints",
    "LeafSpringsTable",
    "LossFactorsTable",
    "MeasuredWall",
    "Mesh",
    "ModalDampingTable",
    "NoDamping",
    "OneDofWall",
    "Output",
    "Patch",
    "Positive",
    "Preload",
    "RayleighDampingTable",
    "Reduction",
    "RigidWall",
    "RomWall",
    "Scene",
    "SceneTable",
    "SensorTable",
    "Time",
    "nearest",
]
