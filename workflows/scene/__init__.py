"""What a run is made of: tables of keys, read from TOML, checked before anything is computed."""

from workflows.scene.chain import LeafSpringsTable, Preload
from workflows.scene.contact import ContactTable
from workflows.scene.damping import (
    Damping,
    LossFactorsTable,
    ModalDampingTable,
    NoDamping,
    RayleighDampingTable,
)
from workflows.scene.joints import Joints, JointStiffnesses
from workflows.scene.mesh import Mesh
from workflows.scene.reduction import Patch, Reduction
from workflows.scene.scene import Scene
from workflows.scene.scene_table import InvalidScene, Positive, SceneTable, nearest
from workflows.scene.sensors import Instrument, Output, SensorTable
from workflows.scene.time import Time
from workflows.scene.walls import (
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
