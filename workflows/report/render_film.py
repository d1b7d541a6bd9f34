"""Frames of a film from the arrays of `workflows.report.film`; run as a process of its own.

python -m workflows.report.render_film FOLDER NAME.mp4
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv
from PIL import Image

from workflows.report.film import RATE, centres
from workflows.report.render import MATT, RAMP, ramp

SIZE = (1248, 624)  # of the view
TOWARDS, REST, AWAY = np.array([[200, 55, 27], [185, 194, 203], [29, 95, 180]]) / 255
HEAD = (11, 92, 173)
FEW = 96  # colours of a GIF


def frames(run: dict, strip: Image.Image):
    """The pictures (h, w, 3) one by one."""
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    rest, faces = run["points"], run["faces"]
    shape = pv.PolyData(rest.copy(), np.insert(faces, 0, 4, axis=1).ravel()) if len(faces) else None
    size = np.linalg.norm(run["u"], axis=2)
    if shape is not None:
        shape["displacement"] = size[0]
        plotter.add_mesh(
            shape, scalars="displacement", cmap=ramp(RAMP, 64), clim=(0, size.max() or 1.0),
            show_scalar_bar=False, **MATT,
        )  # fmt: skip
    balls = _balls(plotter, run)
    words = plotter.add_text("", font_size=11, color="black", position="upper_left")
    _move(balls, run, 0)
    _look(plotter, run)
    for i, t in enumerate(run["t"]):
        if shape is not None:
            shape.points = rest + run["scale_u"] * run["u"][i]
            shape["displacement"] = size[i]
        _move(balls, run, i)
        words.set_text("upper_left", _words(run, t))
        plotter.render()
        yield _above(plotter.screenshot(return_img=True), strip, run["head"], t / run["t"][-1])


def _words(run: dict, t: float) -> str:
    drawn = f"structure x {run['scale_u']:g}, spheres x {run['scale_x']:g}"
    return f"{1e3 * t:.3f} ms    displacements: {drawn}"


def _balls(plotter: pv.Plotter, run: dict) -> list:
    balls = [pv.Sphere(radius=R, theta_resolution=24, phi_resolution=16) for R in run["radius"]]
    return [plotter.add_mesh(ball, color="grey", smooth_shading=True, **MATT) for ball in balls]


def _move(balls: list, run: dict, i: int) -> None:
    at = centres(run["radius"], run["direction"])
    at = at + run["scale_x"] * np.outer(run["x"][i], run["direction"])
    share = run["v"][i] / (np.abs(run["v"]).max() or 1.0)
    for ball, place, s in zip(balls, at, np.sign(share) * np.sqrt(np.abs(share)), strict=True):
        ball.position = place
        ball.prop.color = (REST + abs(s) * ((TOWARDS if s > 0 else AWAY) - REST)).tolist()


def _look(plotter: pv.Plotter, run: dict) -> None:
    d, up = run["direction"], run["up"]
    upright = abs(d @ up) > 0.8
    level = np.cross(np.eye(3)[1 if abs(up[1]) < 0.9 else 0], up)
    side = 0.55 * level - np.cross(up, level) if upright else np.cross(d, up)
    away = side - (0.0 if upright else 0.62) * d + 0.5 * up
    plotter.view_vector(away, viewup=up)
    plotter.enable_parallel_projection()
    right = np.cross(up, away)
    _fit(plotter.camera, run, [w / np.linalg.norm(w) for w in (right, np.cross(away, right))])


def _fit(camera: pv.Camera, run: dict, axes: list[np.ndarray]) -> None:
    """Show spheres and structure whole, a little space around; axes to the right and up."""
    at, R = centres(run["radius"], run["direction"]), run["radius"][:, None]
    shown = np.array(axes)
    seen = np.vstack([(at @ shown.T) - R, (at @ shown.T) + R, run["points"] @ shown.T])
    low, high = seen.min(axis=0), seen.max(axis=0)
    off = (low + high) / 2 - shown @ np.array(camera.focal_point)
    camera.focal_point = np.array(camera.focal_point) + off @ shown
    camera.position = np.array(camera.position) + off @ shown
    width, height = (high - low) / 2
    camera.parallel_scale = 1.12 * max(height, width * SIZE[1] / SIZE[0])


def _above(view: np.ndarray, strip: Image.Image, head: np.ndarray, share: float) -> Image.Image:
    """The view over the strip with its play head."""
    wide = view.shape[1]
    below = np.array(strip.resize((wide, round(strip.height * wide / strip.width))))
    x = int((head[0] + share * (head[1] - head[0])) * wide)
    below[:, x : x + 2] = HEAD
    both = np.vstack([view[..., :3], below])
    return Image.fromarray(both[: both.shape[0] // 2 * 2, : both.shape[1] // 2 * 2])


def main(arguments: list[str]) -> None:
    folder, name = Path(arguments[0]), arguments[1]
    with np.load(folder / "motion.npz") as file:
        run = {key: file[key] for key in file.files}
    pictures = frames(run, Image.open(folder / "strip.png").convert("RGB"))
    if name.endswith(".gif"):
        first, *rest = [picture.quantize(FEW) for picture in pictures]
        first.save(folder / name, save_all=True, append_images=rest, duration=1000 // RATE, loop=0)
        return
    import imageio

    with imageio.get_writer(folder / name, fps=RATE, quality=8, macro_block_size=2) as film:
        for picture in pictures:
            film.append_data(np.asarray(picture))


if __name__ == "__main__":
    main(sys.argv[1:])
