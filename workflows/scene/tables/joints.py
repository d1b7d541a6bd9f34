"""[joints]: springs and dashpots between the bodies of an assembly."""

from beadwave.workflows.scene.scene_table import (
    Dashpot,
    SceneTable,
    Spring,
    TurnDashpot,
    TurnSpring,
)


class JointStiffnesses(SceneTable):
    """Along x, y, z [N/m] and about them [N m/rad]; inf is a rigid direction.

    cx to crz are dashpots parallel to the springs [N s/m], [N m s/rad]; a rigid direction takes
    none.
    """

    kx: Spring = float("inf")  # [N/m] along x of its axes
    ky: Spring = float("inf")  # [N/m] along y of its axes
    # [N/m] along z of its axes: in [[joints]] along the bolt, see frame; of the rig vertical
    kz: Spring = float("inf")
    krx: TurnSpring = float("inf")  # [N m/rad] about x of its axes
    kry: TurnSpring = float("inf")  # [N m/rad] about y of its axes
    krz: TurnSpring = float("inf")  # [N m/rad] about z of its axes
    cx: Dashpot = 0.0  # [N s/m] dashpot along x
    cy: Dashpot = 0.0  # [N s/m] dashpot along y
    cz: Dashpot = 0.0  # [N s/m] dashpot along z
    crx: TurnDashpot = 0.0  # [N m s/rad] about x
    cry: TurnDashpot = 0.0  # [N m s/rad] about y
    crz: TurnDashpot = 0.0  # [N m s/rad] about z

    @property
    def dashpots(self) -> dict[str, float]:
        """Coefficients that are not zero, by the parallel spring."""
        axes = ("x", "y", "z", "rx", "ry", "rz")
        coefficients = {f"k{axis}": getattr(self, f"c{axis}") for axis in axes}
        return {key: value for key, value in coefficients.items() if value}


class Joints(SceneTable):
    """Sheets on the block (head) and on their support (foot)."""

    head: JointStiffnesses = JointStiffnesses()
    foot: JointStiffnesses = JointStiffnesses()
