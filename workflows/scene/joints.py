"""[joints]: springs and dashpots between the bodies of an assembly."""

from workflows.scene.scene_table import (
    Dashpot,
    SceneTable,
    Spring,
    TurnDashpot,
    TurnSpring,
)


class JointStiffnesses(SceneTable):
    """Along x, y, z [N/m] and about them [N m/rad]; inf is a rigid direction.

    cx to crz are dashpots beside the springs [N s/m], [N m s/rad]; a rigid direction takes none.
    """

    kx: Spring = float("inf")
    ky: Spring = float("inf")
    kz: Spring = float("inf")
    krx: TurnSpring = float("inf")
    kry: TurnSpring = float("inf")
    krz: TurnSpring = float("inf")
    cx: Dashpot = 0.0
    cy: Dashpot = 0.0
    cz: Dashpot = 0.0
    crx: TurnDashpot = 0.0
    cry: TurnDashpot = 0.0
    crz: TurnDashpot = 0.0

    @property
    def dashpots(self) -> dict[str, float]:
        """Coefficients that are not zero, by the spring beside them."""
        axes = ("x", "y", "z", "rx", "ry", "rz")
        coefficients = {f"k{axis}": getattr(self, f"c{axis}") for axis in axes}
        return {key: value for key, value in coefficients.items() if value}


class Joints(SceneTable):
    """Sheets on the block (head) and on their support (foot)."""

    head: JointStiffnesses = JointStiffnesses()
    foot: JointStiffnesses = JointStiffnesses()
