"""Examples in the help of each command."""

EXAMPLES = {
    "run": (
        "run --out runs/rig-rom",
        "run rig-1dof --set wall.frequency=269 --set striker.velocity=0.5",
        "run mine.toml --set chain.radius=5mm",
    ),
    "scenes": ("scenes",),
    "scene": ("scene rig-rom > mine.toml",),
    "look": (
        "look gearbox.step --out looked",
        "look gearbox.step --scene mine.toml",
    ),
    "modes": (
        "modes rig-rom --out runs/modes",
        "modes rig-rom --set assembly.sheet_thickness=2mm",
        "modes rig-rom --inp rig.inp --step rig.step",
    ),
    "tune": (
        "tune rig-rom --match 1,3,4",
        "tune rig-rom --match 1=50.2,2=272,3=901,4=8390 --out mine.toml",
        "tune rig-rom --hammer test.csv",
        "tune mine.toml --rank",
        "tune mine.toml --free joints.cover.kz --posterior",
        "tune mine.toml --damping --out damped.toml",
        "tune mine.toml --free joints.cover.kz,materials.steel.young",
    ),
    "hammer": (
        "hammer hits.uff --out hammer",
        "hammer hit_1.wav hit_2.wav --points points.csv --reject 3,7",
        "hammer points.csv --design 12 --scene mine.toml --band 0:2000",
        "hammer synthetic.csv --synthetic",
    ),
    "sweep": (
        "sweep rig-1dof --over wall.frequency=100:1000:19 --over wall.mass=1,3",
        "sweep rig-rigid --over striker.velocity=0.1:1 --over preload.force=1:50 --sample lhs:1000",
        "sweep --open sweeps/rig-rigid --of sphere_14_echo_delay_s --against striker.velocity",
    ),
    "scan": (
        "scan rig-rom --grid 20x20",
        "scan mine.toml --face plate:+z --grid 30x10 --out scanned",
    ),
    "reduce": (
        "reduce rig-rom --out rom.mat",
        "reduce rig-rom --out rom.npz --matrices full.mat",
    ),
    "impact": (
        "impact rig-rigid",
        "impact rig-1dof --rom rom.npz --out runs/impact",
        "impact rig-1dof --json | jq .peak_wall_force_N",
    ),
    "accuracy": (
        "accuracy --stage time --out accuracy",
        "accuracy rig-half-space --stage time",
    ),
    "stability": ("stability --case one-dof-wall --out stability",),
    "verify": ("verify", "verify --group solitary-wave --out verify", "verify --list"),
    "calibrate": ("calibrate rig-1dof data.csv --instrument 100e3 --out calibrated",),
    "inspect": (
        "inspect sensed-beam drop1.csv drop2.csv --find beam.thickness,beam.young",
        "inspect sensed-beam drop1.csv --find beam.axial_force --bounds beam.axial_force=-35kN:5kN",
    ),
    "design": (
        "design sensed-beam --find beam.thickness,beam.young",
        "design sensed-beam --find beam.thickness --over chain.count=9,17 --out design",
    ),
    "report": ("report runs/rig-rom",),
    "film": ("film runs/rig-rom", "film runs/rig-rom --out impact.gif", "film runs/rig-rom --pvd"),
    "doctor": ("doctor",),
}
