"""Planes, cylinders, cones, spheres and tori that a STEP file has as B-spline surfaces, recognised.

Some systems write every face as a B-spline. Points of the surface, on a grid over its knots, are
compared with the surface of each kind that has the least squares of their distances; where all are
nearer than ALIKE times the size of the surface, its entity is written anew as that kind, and lines
and circles among the curves likewise. Edges stay where they are, so that trimmed and split faces
stay so. What no kind fits stays a B-spline.

A surface of revolution has normals n at points p that all meet its axis (c, a): with Pluecker's
coordinates of a line, n . (c x a) + (p x n) . a = 0 at every point (H. Pottmann and J. Wallner,
Computational Line Geometry (2001), 3.3).
"""

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from beadwave.geometry.cad.solids import Vector

# largest distance of a point of the B-spline from the recognised surface or curve, over the size of
# the B-spline: 2 um of 100 mm. Exact conversions are off by 1e-9, approximations by 1e-5 to 1e-4
ALIKE = 2e-5
N_POINTS = 9  # points along each side of the grid
# smallest singular value of the lines over the largest, beyond which normals meet no common axis;
# splines within ALIKE of a cylinder have 1e-4
MEET = 1e-2
# distance of a point from the surface about the axis that normals meet, over the size, beyond which
# least squares need not be tried: the axis of splines within ALIKE is off by 1e-3
GUESSED = 5e-3

ENTITY = re.compile(r"#(\d+)\s*=\s*((?:[^;']|'(?:[^']|'')*')*);")
TOKEN = re.compile(r"'(?:[^']|'')*'|#\d+|[(),]|[^\s(),']+")
SPLINE = re.compile(r"B_SPLINE_(?:SURFACE|CURVE)|QUASI_UNIFORM|BEZIER_(?:SURFACE|CURVE)")
FLAG = re.compile(r"\.[TF]\.(?=[^.]*$)")  # the last of an entity
DEGREE = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'DEGREES?'", re.I)
WITH_CURVE = ("SURFACE_CURVE", "SEAM_CURVE", "INTERSECTION_CURVE")


class AnalyticShape(NamedTuple):
    """A surface or a curve of a known kind, with an axis system: origin, axis z and direction x."""

    kind: str  # name of the entity in ISO 10303-42
    origin: Vector  # (3,) in the file's unit, as all lengths here
    z: Vector  # (3,) unit vector
    x: Vector  # (3,) unit vector normal to it
    numbers: tuple[float, ...] = ()  # radii, half angle [rad]
    turned: bool = False  # whether its normal is opposite to that of the B-spline


def analytic(text: str) -> str | None:
    """The text of a STEP file with what is recognised in place of B-splines; None where no surface
    is."""
    if not SPLINE.search(text):
        return None
    entities = {int(n): content for n, content in ENTITY.findall(text)}
    parsed = {n: _records(c) for n, c in entities.items() if SPLINE.search(c)}
    points = {
        n: np.array(_records(c)["CARTESIAN_POINT"][1], float)
        for n, c in entities.items()
        if c.lstrip().startswith("CARTESIAN_POINT")
    }
    surfaces, curves = {}, {}
    for n, records in parsed.items():
        try:
            spline = _spline(records, points)
        except (KeyError, ValueError, IndexError, TypeError):
            continue  # of a form that is not read here
        if len(spline.degrees) == 2:
            surfaces[n] = surface_of(spline)
        else:
            curves[n] = curve_of(spline)
    surfaces = {n: known for n, known in surfaces.items() if known}
    if not surfaces:
        return None

    # new entities stand in the places of the old ones, their axes at the end
    last, extra, changed = max(entities), [], {}
    in_degrees = bool(DEGREE.search(text))
    for n, known in {**surfaces, **{n: c for n, c in curves.items() if c}}.items():
        axes = (
            f"CARTESIAN_POINT('',({_numbers(known.origin)}))",
            f"DIRECTION('',({_numbers(known.z)}))",
            f"DIRECTION('',({_numbers(known.x)}))",
        )
        extra += [f"#{last + i}={content};" for i, content in enumerate(axes, start=1)]
        if known.kind == "LINE":
            extra.append(f"#{last + 4}=VECTOR('',#{last + 2},1.);")
            changed[n] = f"LINE('',#{last + 1},#{last + 4})"
        else:
            places = f"#{last + 1},#{last + 2},#{last + 3}"
            extra.append(f"#{last + 4}=AXIS2_PLACEMENT_3D('',{places});")
            numbers = known.numbers
            if known.kind == "CONICAL_SURFACE" and in_degrees:
                numbers = (numbers[0], np.degrees(numbers[1]))
            rest = "".join(f",{_real(number)}" for number in numbers)
            changed[n] = f"{known.kind}('',#{last + 4}{rest})"
        last += 4

    def renewed(match: re.Match) -> str:
        n, content = int(match[1]), match[2]
        if n in changed:
            return f"#{n}={changed[n]};"
        head = content.lstrip()
        if head.startswith(("ADVANCED_FACE", "FACE_SURFACE")):
            *_, surface, sense = _records(content).popitem()[1]
            known = surfaces.get(int(surface[1:]))
            if known and known.turned:
                other = ".F." if sense == ".T." else ".T."
                return f"#{n}={FLAG.sub(other, content)};"
        # curves on surfaces carry their images in the coordinates of the surface, which change
        elif head.startswith("EDGE_CURVE"):
            *_, curve, _ = _records(content)["EDGE_CURVE"]
            there = entities.get(int(curve[1:]), "")
            if there.lstrip().startswith(WITH_CURVE):
                bare = _records(there).popitem()[1][1]
                pattern = re.compile(curve + r"(?!\d)")
                return f"#{n}={pattern.sub(bare, content)};"
        return match[0]

    body = ENTITY.sub(renewed, text)
    end = body.rindex("ENDSEC")
    return body[:end] + "\n".join(extra) + "\n" + body[end:]


class Spline(NamedTuple):
    """A rational B-spline of one or two parameters."""

    degrees: tuple[int, ...]
    knots: tuple[NDArray[np.float64], ...]
    control: NDArray[np.float64]  # (n, 4) or (n, m, 4): weight times x, y, z, and the weight

    def at(self, *parameters: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Points (..., 3) on the grid of these parameters, and their derivatives along each."""
        values, slopes = [], []
        for degree, knots, u in zip(self.degrees, self.knots, parameters, strict=True):
            basis = BSpline(knots, np.eye(len(knots) - degree - 1), degree)
            values.append(basis(u))
            slopes.append(basis.derivative()(u))

        def of(factors):
            if len(factors) == 1:
                return factors[0] @ self.control
            return np.einsum("ai,bj,ijk->abk", *factors, self.control)

        whole = of(values)
        points, weight = whole[..., :3] / whole[..., 3:], whole[..., 3:]
        derivatives = []
        for i in range(len(values)):
            slope = of([slopes[k] if k == i else v for k, v in enumerate(values)])
            derivatives.append((slope[..., :3] - slope[..., 3:] * points) / weight)
        return points, *derivatives

    def grid(self, *, coarse: bool = False) -> tuple[NDArray[np.float64], ...]:
        """Parameters (n,) along each: some in every span, at least N_POINTS in all, of a `coarse`
        grid no more."""
        along = []
        for degree, knots in zip(self.degrees, self.knots, strict=True):
            spans = np.unique(knots[degree : len(knots) - degree])
            if coarse:
                along.append(np.linspace(spans[0], spans[-1], N_POINTS))
                continue
            n = max(3, 1 + (N_POINTS - 1) // (len(spans) - 1))
            parts = [np.linspace(*pair, n) for pair in pairwise(spans)]
            along.append(np.unique(np.concatenate(parts)))
        return tuple(along)


def surface_of(spline: Spline) -> AnalyticShape | None:
    """The plane, cylinder, cone, sphere or torus that a B-spline surface is; None for others, most
    of which a few points tell."""
    if _fitted(spline, *spline.grid(coarse=True)) is None:
        return None
    return _fitted(spline, *spline.grid())


def _fitted(spline: Spline, u: NDArray[np.float64], v: NDArray[np.float64]) -> AnalyticShape | None:
    """The surface of a known kind on which the points of a B-spline at parameters u (n,), v (m,)
    lie; None where there is none."""
    grid, along_u, along_v = spline.at(u, v)
    p = grid.reshape(-1, 3)
    n = np.cross(along_u, along_v).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(p, axis=0)))
    length = np.linalg.norm(n, axis=1)
    regular = length > 1e-6 * length.max(initial=0.0)  # not at poles
    if not size or not regular.any():
        return None
    n = n[regular] / length[regular, None]
    q = p[regular]
    allowed, middle = ALIKE * size, p.mean(axis=0)

    # plane: the direction of the least extent
    z = np.linalg.svd(p - middle, full_matrices=False)[2][2]
    if np.abs((p - middle) @ z).max() < allowed:
        z = z * np.sign(n.sum(axis=0) @ z)
        return AnalyticShape("PLANE", p[0] - ((p[0] - middle) @ z) * z, z, _across(z))

    # sphere: rho^2 = 2 c rho + d, linear in c and d
    rho = (p - middle) / size
    equations = np.column_stack([2 * rho, np.ones(len(rho))])
    (*c, d), *_ = np.linalg.lstsq(equations, (rho**2).sum(axis=1), rcond=None)
    centre, radius = middle + size * np.array(c), size * np.sqrt(max(d + np.dot(c, c), 0.0))
    if np.abs(np.linalg.norm(p - centre, axis=1) - radius).max() < allowed and radius < 100 * size:
        poles = _poles(grid, centre)
        turned = bool(np.mean(np.sum(n * (q - centre), axis=1)) < 0)
        return AnalyticShape("SPHERICAL_SURFACE", centre, *poles, (radius,), turned)

    # axis of revolution: the line that all normals meet
    m = np.cross((q - middle) / size, n)
    _, s, lines = np.linalg.svd(np.column_stack([m, n]), full_matrices=False)
    if s[-1] > MEET * s[0]:
        return None
    # those of a cylinder meet the line at infinity across it too: of what is left to choose, the
    # line with the largest direction
    lines = lines[s <= max(s[-1], 1e-3 * s[0])]
    choice = np.linalg.svd(lines[:, :3])[0][:, 0] @ lines
    if np.linalg.norm(choice[:3]) < 1e-6:
        return None
    start, tilt = _line(choice, middle, size)
    for kind in ("CYLINDRICAL_SURFACE", "CONICAL_SURFACE", "TOROIDAL_SURFACE"):
        known = _revolved(kind, p, start, tilt, size)
        if known is None:
            continue
        # x towards the first point, at which the seam of a closed surface lies
        foot = grid[0, 0] - known.origin
        x = foot - (foot @ known.z) * known.z
        if np.linalg.norm(x) < 1e-9 * size:
            x = _across(known.z)
        outward = q - known.origin
        outward = outward - np.outer(outward @ known.z, known.z)
        if kind == "TOROIDAL_SURFACE":
            ring = known.origin + known.numbers[0] * outward / np.linalg.norm(
                outward, axis=1, keepdims=True
            )
            outward = q - ring
        turned = bool(np.mean(np.sum(n * outward, axis=1)) < 0)
        return known._replace(x=x / np.linalg.norm(x), turned=turned)
    return None


def curve_of(spline: Spline) -> AnalyticShape | None:
    """The line or circle that a B-spline curve is, in its direction; None for others."""
    (t,) = spline.grid()
    p, along = spline.at(t)
    size = float(np.linalg.norm(np.ptp(p, axis=0)))
    if not size:
        return None
    middle = p.mean(axis=0)
    _, _, axes = np.linalg.svd(p - middle, full_matrices=False)
    off = (p - middle) - np.outer((p - middle) @ axes[0], axes[0])
    if np.linalg.norm(off, axis=1).max() < ALIKE * size:
        z = axes[0] * np.sign((p[-1] - p[0]) @ axes[0])
        return AnalyticShape("LINE", p[0], z, _across(z))
    z = axes[2]
    if np.abs((p - middle) @ z).max() > ALIKE * size:
        return None
    rho = (p - middle) @ axes[:2].T / size
    equations = np.column_stack([2 * rho, np.ones(len(rho))])
    (*c, d), *_ = np.linalg.lstsq(equations, (rho**2).sum(axis=1), rcond=None)
    centre, radius = (
        middle + size * np.array(c) @ axes[:2],
        size * np.sqrt(max(d + np.dot(c, c), 0.0)),
    )
    arms = p - centre
    if np.abs(np.linalg.norm(arms, axis=1) - radius).max() > ALIKE * size or radius > 100 * size:
        return None
    z = z * np.sign(np.cross(arms[0], along[0]) @ z)
    x = arms[0] - (arms[0] @ z) * z
    return AnalyticShape("CIRCLE", centre, z, x / np.linalg.norm(x), (radius,))


def _revolved(kind: str, p, start: Vector, a: Vector, size: float) -> AnalyticShape | None:
    """A cylinder, cone or torus about an axis near the line through `start` along `a` that fits
    points p (n, 3); None where one is farther off than ALIKE."""
    b, c = np.linalg.svd(a[None])[2][1:]

    def profile(x):
        """Distances from the axis and heights along it, in sizes."""
        axis = a + x[0] * b + x[1] * c
        axis = axis / np.linalg.norm(axis)
        arm = (p - start) / size - x[2] * b - x[3] * c
        heights = arm @ axis
        return np.linalg.norm(arm - np.outer(heights, axis), axis=1), heights, axis

    rho, h, _ = profile(np.zeros(4))
    if kind == "CYLINDRICAL_SURFACE":
        first = [rho.mean()]

        def off(x):
            rho, _, _ = profile(x)
            return rho - x[4]

    elif kind == "CONICAL_SURFACE":
        first = np.polyfit(h, rho, 1)

        def off(x):
            rho, h, _ = profile(x)
            return (rho - x[4] * h - x[5]) / np.hypot(1, x[4])

    else:
        equations = np.column_stack([2 * rho, 2 * h, np.ones(len(rho))])
        R, height, d = np.linalg.lstsq(equations, rho**2 + h**2, rcond=None)[0]
        first = [R, height, np.sqrt(max(d + R**2 + height**2, 0.0))]

        def off(x):
            rho, h, _ = profile(x)
            return np.hypot(rho - x[4], h - x[5]) - x[6]

    guess = np.array([0.0, 0.0, 0.0, 0.0, *first])
    if np.abs(off(guess)).max() > GUESSED:
        return None
    fit = least_squares(off, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=20)
    x = fit.x
    if np.abs(fit.fun).max() > ALIKE or np.abs(x).max() > 100:
        return None
    _, h, axis = profile(x)
    origin = start + size * (x[2] * b + x[3] * c)
    if kind == "CYLINDRICAL_SURFACE":
        return AnalyticShape(kind, origin + size * h.min() * axis, axis, axis, (size * x[4],))
    if kind == "CONICAL_SURFACE":
        # the half angle is positive: the axis points to where the cone widens
        if x[4] < 0:
            axis, h, x[4] = -axis, -h, -x[4]
        low = h.min()
        radius = x[5] + x[4] * low
        if radius < -ALIKE:  # both halves of a double cone
            return None
        numbers = size * max(radius, 0.0), float(np.arctan(x[4]))
        return AnalyticShape(kind, origin + size * low * axis, axis, axis, numbers)
    R, r = size * x[4], size * x[6]
    if r <= 0 or r >= R:  # a torus that crosses itself
        return None
    return AnalyticShape(kind, origin + size * x[5] * axis, axis, axis, (R, r))


def _line(pluecker: NDArray, middle: Vector, size: float) -> tuple[Vector, Vector]:
    """A point of a line and its unit vector, of its coordinates (direction, moment) about the
    middle."""
    a, moment = pluecker[:3], pluecker[3:]
    a, moment = a / np.linalg.norm(a), moment / np.linalg.norm(a)
    return middle + size * np.cross(a, moment), a


def _poles(grid: NDArray, centre: Vector) -> tuple[Vector, Vector]:
    """Axis and direction of a sphere's coordinates: where the grid shrinks to a pole, there; x
    towards its first point."""
    z, size = np.eye(3)[2], np.ptp(grid.reshape(-1, 3), axis=0).max()
    for line in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
        if np.ptp(line, axis=0).max() < 1e-9 * size:
            z = line[0] - centre
    z = z / np.linalg.norm(z)
    x = grid[len(grid) // 2, 0] - centre
    x = x - (x @ z) * z
    if np.linalg.norm(x) < 1e-6 * np.linalg.norm(grid[0, 0] - centre):
        x = grid[0, grid.shape[1] // 2] - centre
        x = x - (x @ z) * z
    if np.linalg.norm(x) == 0:
        x = _across(z)
    return z, x / np.linalg.norm(x)


def _across(z: Vector) -> Vector:
    """A unit vector normal to another one."""
    x = np.eye(3)[np.abs(z).argmin()]
    x = x - (x @ z) * z
    return x / np.linalg.norm(x)


def _spline(records: dict, points: dict[int, Vector]) -> Spline:
    """The B-spline of an entity's records; raises KeyError or ValueError for other forms."""
    surface = any("SURFACE" in name for name in records)
    n_degrees = 2 if surface else 1
    base, kind = None, "BEZIER"
    for name, arguments in records.items():
        if name in ("B_SPLINE_SURFACE", "B_SPLINE_CURVE"):
            base = arguments
        if "WITH_KNOTS" in name:
            kind = "WITH_KNOTS"
        elif name.startswith("QUASI"):
            kind = "QUASI"
    if base is None:  # a simple record: its name comes first
        ((_, arguments),) = records.items()
        base = arguments[1:]
    degrees = tuple(int(word) for word in base[:n_degrees])
    rows = base[n_degrees]
    if surface:
        control = np.array([[points[int(word[1:])] for word in row] for row in rows])
    else:
        control = np.array([points[int(word[1:])] for word in rows])
    shape = control.shape[:-1]
    if control.shape[-1] != 3:
        raise ValueError("an image in the coordinates of a surface")

    if kind == "WITH_KNOTS":
        name = next(name for name in records if "WITH_KNOTS" in name)
        tail = records[name]
        tail = tail[-5:-1] if surface else tail[-3:-1]
        counts, values = tail[:n_degrees], tail[n_degrees:]
        knots = tuple(
            np.repeat(np.array(value, float), np.array(count, int))
            for count, value in zip(counts, values, strict=True)
        )
    else:
        knots = []
        for n, degree in zip(shape, degrees, strict=True):
            inner = np.arange(1, n - degree) if kind == "QUASI" else np.repeat(
                np.arange(1, (n - 1) // degree), degree
            )  # fmt: skip
            ends = inner.max(initial=0) + 1
            knots.append(np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, ends)]))
        knots = tuple(np.array(k, float) for k in knots)
    if any(len(k) != n + d + 1 for k, n, d in zip(knots, shape, degrees, strict=True)):
        raise ValueError("knots do not fit")

    weights = np.ones(shape)
    for name, arguments in records.items():
        if name.startswith("RATIONAL"):
            weights = np.array(arguments[0], float)
    if weights.shape != shape or not (weights > 0).all():
        raise ValueError("weights do not fit")
    weighted = np.concatenate([control * weights[..., None], weights[..., None]], axis=-1)
    return Spline(degrees, knots, weighted)


def _records(content: str) -> dict[str, list]:
    """Arguments by name of an entity's records, one or, of a complex one, several; lists for
    parentheses, texts for all else."""
    tokens = iter(TOKEN.findall(content))

    def inside() -> list:
        values = []
        for token in tokens:
            if token == ")":
                return values
            if token == "(":
                values.append(inside())
            elif token != ",":
                values.append(token)
        return values

    flat = []
    for token in tokens:
        flat.append(inside() if token == "(" else token)
    if len(flat) == 1:
        flat = flat[0]
    return dict(zip(flat[0::2], flat[1::2], strict=True))


def _numbers(vector: Vector) -> str:
    return ",".join(map(_real, vector))


def _real(x: float) -> str:
    """A number with the point that ISO 10303-21 asks for: 1., 1.E-05."""
    mantissa, mark, exponent = f"{x + 0.0:.15G}".partition("E")
    return f"{mantissa}{'' if '.' in mantissa else '.'}{mark}{exponent}"
