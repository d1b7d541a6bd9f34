"""Keys of sensors and of the instrument that are each allowed but not together, a sentence each."""

from collections.abc import Iterator
from re import fullmatch

from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.sensors import OF_FACES, OF_SPHERES, SensorTable, low_pass_of
from beadwave.workflows.scene.tables.shakers import AXES, FACE
from beadwave.workflows.scene.tables.walls import RomWall

MOST_SAMPLES = 1e6  # of an instrument; not varied


def of_sensors(scene: Scene) -> Iterator[str]:
    """Sensors on the spheres, and the instrument that records them."""
    sensors, instrument = scene.output.sensors or (), scene.output.instrument
    if instrument and not sensors:
        yield "output.instrument records nothing; add output.sensors, or drop it."
    count = {row.name: row.count for row in scene.chains or ()}
    if scene.chain:
        count = {None: scene.chain.count}
    labels, quantity_of = set(), {}
    for i, sensor in enumerate(sensors, start=1):
        key = f"output.sensors.{i}"
        yield from _of_place(scene, sensor, key)
        if sensor.chain is not None and (scene.chain or sensor.on is not None):
            yield f"{key}.chain is of a sensor on a sphere of [[chains]]; drop it."
        elif sensor.sphere is not None and sensor.chain not in count:
            shown = "missing" if sensor.chain is None else f'"{sensor.chain}"'
            yield (
                f"{key}.chain is {shown}, allowed are {', '.join(map(str, count))}; name the chain "
                "whose sphere it is."
            )
        elif sensor.sphere is not None and sensor.sphere > count[sensor.chain]:
            chain = "chain" if scene.chain else f"chains.{sensor.chain}"
            yield (
                f"{key}.sphere = {sensor.sphere}, allowed are 1 to {chain}.count = "
                f"{count[sensor.chain]}; change it or add spheres."
            )
        if sensor.label in labels:
            yield f"{key} is a second sensor of {sensor.label}; drop it."
        labels.add(sensor.label)

        # sensors that share an unknown gain have to show one quantity, that of the first of them
        gain = sensor.gain
        if (
            isinstance(gain, str)
            and quantity_of.setdefault(gain, sensor.quantity) != sensor.quantity
        ):
            yield f"{key}.gain = {gain!r} is another quantity's; give it a name of its own."
        if gain == 0:
            yield f"{key}.gain = 0 shows nothing; give another, or a name if it is not known."
        if sensor.low_pass and sensor.high_pass and sensor.high_pass >= sensor.low_pass:
            yield (
                f"{key}.high_pass = {sensor.high_pass:g} Hz must be below its low_pass = "
                f"{sensor.low_pass:g} Hz; lower it."
            )
    if instrument:
        n = instrument.sampling * scene.time.duration if scene.time else 0.0
        if not 2 <= n <= MOST_SAMPLES:
            yield (
                f"output.instrument.sampling = {instrument.sampling:g} Hz takes {n:.3g} samples in "
                f"time.duration, allowed are 2 to {MOST_SAMPLES:.0e}; change one of them."
            )


def _of_place(scene: Scene, sensor: SensorTable, key: str) -> Iterator[str]:
    """Sentences on what carries a sensor: a sphere, or a face of the structure."""
    if (sensor.sphere is None) == (sensor.on is None):
        yield f"{key} sits on a sphere or on a face of the structure; give one of sphere and on."
        return
    allowed = OF_SPHERES if sensor.on is None else OF_FACES
    if sensor.quantity not in allowed:
        place = "a sphere" if sensor.on is None else "a face"
        yield (
            f'{key}.quantity = "{sensor.quantity}", allowed of {place} are {", ".join(allowed)}; '
            "change it."
        )
    if sensor.on is None:
        for name in ("at", "radius", "direction"):
            if getattr(sensor, name) is not None:
                yield f"{key}.{name} is of a sensor on a face; drop it, or name a face in {key}.on."
        return
    reduced = isinstance(scene.wall, RomWall) and scene.wall.file is None
    if not (reduced or scene.chains) or scene.bending:
        yield (
            f'{key}.on = "{sensor.on}" is a face of an assembly, which this wall does not have; '
            'take wall.kind = "rom" with [assembly], or a sensor of a sphere.'
        )
    elif not fullmatch(FACE, sensor.on):
        yield f'{key}.on = "{sensor.on}" is no face; name one, as on = "block:+y".'
    elif scene.has_dashpots:
        yield (
            f"{key} reads a structure by its modes, which dashpots and [[measured]] couple; drop "
            "these, or take a sensor of a sphere."
        )
    low_pass = low_pass_of(sensor, scene.reduction)
    if sensor.high_pass and not sensor.low_pass and sensor.high_pass >= low_pass:
        yield (
            f"{key}.high_pass = {sensor.high_pass:g} Hz must be below the low pass of a sensor on "
            f"a face, {low_pass:g} Hz without low_pass; lower it, or give low_pass."
        )
    words = isinstance(sensor.direction, str)
    if sensor.direction is None or (words and sensor.direction not in (*AXES, "normal")):
        shown = f'"{sensor.direction}"' if words else "missing"
        yield (
            f'{key}.direction is {shown}, allowed are "x", "y", "z", "normal" and vectors; '
            "change it."
        )
    elif not words and not any(sensor.direction):
        yield f"{key}.direction = {list(sensor.direction)} has no length; give another vector."
