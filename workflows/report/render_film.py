"""Frames of a film from the arrays of `workflows.report.film`; run as a child process.

    python -m beadwave.workflows.report.render_film FOLDER NAME.mp4

Pillow writes a GIF in two lines, imageio an MP4 in three. Not pyvista's writer (`Plotter.open_gif`,
`open_movie`, `write_frame`), which is imageio as well: it takes what its window shows, without the
strip of velocities below, and would refuse a GIF in an installation without the extra `film`. Nor
is it quicker: 60 frames of the rig as a GIF take 8.0 s and 2.0 MB by Pillow, 8.5 s and 2.7 MB by
imageio, in addition to 12 s of rendering; as an MP4 0.2 s.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyvista as pv
from PIL import Image

from beadwave.workflows.report.film import centres
from beadwave.workflows.report.render import MATT, RAMP, ramp

SIZE = (1248, 624)  # of the view, in pixels
TOWARDS, REST, AWAY = np.array([[200, 55, 27], [185, 194, 203], [29, 95, 180]]) / 255
HEAD = (11, 92, 173)


def frames(run: dict, strip: Image.Image) -> Iterator[Image.Image]:
    """The pictures one by one: the view over the strip with its play head."""
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")

    # the structure, coloured by the size of its displacement
    at_rest, faces = run["points"], run["faces"]
    size = np.linalg.norm(run["u"], axis=2)
    shape = (
        pv.PolyData(at_rest.copy(), np.insert(faces, 0, 4, axis=1).ravel()) if len(faces) else None
    )
    if shape is not None:
        shape["displacement"] = size[0]
        plotter.add_mesh(
            shape, scalars="displacement", cmap=ramp(RAMP, 64), clim=(0, size.max() or 1.0),
            show_scalar_bar=False, **MATT,
        )  # fmt: skip

    # spheres, red towards the wall and blue away from it, by the root of their velocity: faint
    # waves are visible as well
    spheres = [
        plotter.add_mesh(
            pv.Sphere(radius=R, theta_resolution=24, phi_resolution=16),
            color="grey", smooth_shading=True, **MATT,
        )
        for R in run["radius"]
    ]  # fmt: skip
    motion = run["scale_x"] * (run["x"][..., None] * run["direction"])
    places = centres(run["radius"], run["direction"]) + motion
    share = run["v"] / (np.abs(run["v"]).max() or 1.0)
    strength = np.sign(share) * np.sqrt(np.abs(share))

    factors = f"structure x {run['scale_u']:g}, spheres x {run['scale_x']:g}"
    caption = plotter.add_text("", font_size=11, color="black", position="upper_left")

    # the camera's depth comes from where the spheres are
    for sphere, place in zip(spheres, places[0], strict=True):
        sphere.position = place
    _aim(plotter, run)

    start, end = run["head"]
    for i, t in enumerate(run["t"]):
        if shape is not None:
            shape.points = at_rest + run["scale_u"] * run["u"][i]
            shape["displacement"] = size[i]
        for sphere, place, s in zip(spheres, places[i], strength[i], strict=True):
            sphere.position = place
            sphere.prop.color = (REST + abs(s) * ((TOWARDS if s > 0 else AWAY) - REST)).tolist()
        caption.set_text("upper_left", f"{1e3 * t:.3f} ms    displacements: {factors}")
        plotter.render()
        view = plotter.screenshot(return_img=True)[..., :3]

        width = view.shape[1]
        below = np.array(strip.resize((width, round(strip.height * width / strip.width))))
        head = int((start + t / run["t"][-1] * (end - start)) * width)
        below[:, head : head + 2] = HEAD
        picture = np.vstack([view, below])
        # an MP4 takes even numbers of pixels only
        yield Image.fromarray(picture[: len(picture) // 2 * 2, : width // 2 * 2])


def _aim(plotter: pv.Plotter, run: dict) -> None:
    """Look from the side and from above, the chain from left to right or upright, all in view."""
    d, up = run["direction"], run["up"]
    upright = abs(d @ up) > 0.8
    level = np.cross(np.eye(3)[1 if abs(up[1]) < 0.9 else 0], up)
    side = 0.55 * level - np.cross(up, level) if upright else np.cross(d, up)
    to_eye = side - (0.0 if upright else 0.62) * d + 0.5 * up
    plotter.view_vector(to_eye, viewup=up)
    plotter.enable_parallel_projection()

    # spheres at rest and structure in coordinates to the right and upwards, (k, 2)
    right = np.cross(up, to_eye)
    above = np.cross(to_eye, right)
    axes = np.array([right / np.linalg.norm(right), above / np.linalg.norm(above)])
    middles = centres(run["radius"], d) @ axes.T
    R = run["radius"][:, None]
    places = np.vstack([middles - R, middles + R, run["points"] @ axes.T])
    low, high = places.min(axis=0), places.max(axis=0)

    camera = plotter.camera
    shift = ((low + high) / 2 - axes @ np.array(camera.focal_point)) @ axes
    camera.focal_point = np.array(camera.focal_point) + shift
    camera.position = np.array(camera.position) + shift
    width, height = (high - low) / 2
    camera.parallel_scale = 1.12 * max(height, width * SIZE[1] / SIZE[0])  # a little space around


def main(arguments: list[str]) -> None:
    """Write the film that the command line names."""
    folder, name = Path(arguments[0]), arguments[1]
    with np.load(folder / "film.npz") as file:
        run = {key: file[key] for key in file.files}
    pictures, rate = frames(run, Image.open(folder / "strip.png").convert("RGB")), int(run["rate"])
    if name.endswith(".gif"):
        # 96 colours: grey spheres, three ramps of colour and curves; fewer bytes than with 256
        first, *others = [picture.quantize(96) for picture in pictures]
        first.save(
            folder / name, save_all=True, append_images=others, duration=1000 // rate, loop=0
        )
        return
    import imageio

    with imageio.get_writer(folder / name, fps=rate, quality=8, macro_block_size=2) as film:
        for picture in pictures:
            film.append_data(np.asarray(picture))


if __name__ == "__main__":
    main(sys.argv[1:])
