"""Error over unknowns of an L-bracket whose elements follow from mesh.error, and of even ones.

You will see, of hexahedra and of tetrahedra, each error asked with the unknowns, the error stated
and the true one of the first three frequencies, then the same of even elements, and the exponents

    error ~ N^-p,    p = min(4/3, 2 lambda) = 1.09 graded, 2 lambda / 3 = 0.36 even

lambda = 0.5445 is the exponent of displacements at the inner edge of 270 degrees (Williams, J.
Appl. Mech. 19 (1952) 526): energies missed there fall as h^(2 lambda). With elements graded
towards the edge, about as long along it as across, N >= length / h; hexahedra may be longer.

The first is the limit of many unknowns. Tetrahedra of the size h at a distance r from the edge miss
the density h^4 r^(2 lambda - 6), those at the edge, of the size r0, some r0^(2 lambda). The fewest,
N ~ int r / h^3 dr + 1 / (2 r0), have h = kappa r^((6 - 2 lambda) / 7) from h(r0) = r0 on. Near and
far parts change with r0 nearly alike, as 2 lambda is close to 4/3: the exponent of these best sizes
grows slowly; it is printed for the unknowns of the tetrahedra, in a sector of the same area.

        |####|
        |####|           inner edge, along z
        |####|__________/
        |###############|
    ////|###############|////    held from below

True frequencies are those of a grid of hexahedra graded towards the edge, extrapolated from
innermost elements of 0.4 and 0.1 mm.

Run it: python examples/bracket_rate.py               both, from 10 to 0.5 %, four minutes
        python examples/bracket_rate.py hex 0.05 0.02
"""

import sys

import numpy as np
from scipy.integrate import cumulative_trapezoid
from skfem import MeshHex

from beadwave import fem
from beadwave.geometry.meshing.grid_lines import Stop, lines_through, refined
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.errors.adapted_sizes import search, solved_on
from beadwave.workflows.stages.structure import bodies

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
A, B, W, T = 0.06, 0.07, 0.012, 0.03  # [m] foot, wall, thickness of both, length of the edge
N_MODES = 3
ASKED = (0.1, 0.05, 0.02, 0.01, 0.005)  # mesh.error
SCALES = (2.0, 1.4, 1.0, 0.7, 0.5)  # mesh.scale of even elements
INNERMOST = (4e-4, 1e-4)  # [m] elements at the edge of the grids that stand for the truth
LARGEST = 5e-3  # [m] of these, where 8e-3 changes frequencies by 6e-5
TWO_LAMBDA = 2 * 0.5445  # power of the innermost element with which errors fall
OF_EDGE = (1.0, 30.0)  # energy of elements at the edge over r0^(2 lambda), of a density of one
DENSITY = 55.0  # unknowns in h^3, of even tetrahedra


def bracket(element: str) -> Scene:
    outline = [[0, 0], [A, 0], [A, W], [W, W], [W, B], [0, B]]
    return load_scene(
        {
            "name": "bracket",
            "bodies": {"bracket": {"plate": {"outline": outline, "thickness": T}}},
            "assembly": {"held": ["bracket:-y"], "material": "steel"},
            "materials": {"steel": STEEL},
            "mesh": {"element": element, "error": ASKED[0], "modes": N_MODES},
        }
    )


def frequencies(innermost: float) -> np.ndarray:
    """Of a grid graded towards the inner edge, and 8 times less towards the ends of the foot and of
    the edge [Hz]."""
    outer = [refined(at, 8 * innermost) for at in (0.0, A)]
    x = lines_through([outer[0], refined(W, innermost), outer[1]], LARGEST)
    y = lines_through([outer[0], refined(W, innermost), Stop(B)], LARGEST)
    z = lines_through([refined(at, 32 * innermost) for at in (0.0, T)], LARGEST)
    mesh = MeshHex.init_tensor(x, y, z)
    beyond = np.all(mesh.p[:2, mesh.t].mean(axis=1) > W, axis=0)
    mesh = mesh.remove_elements(np.flatnonzero(beyond))
    mesh = mesh.with_boundaries({"foot": lambda at: at[1] == 0.0})
    structure = fem.assemble({"bracket": mesh}, {"bracket": fem.Material(**STEEL)})
    held = fem.Connections(held=[fem.HeldFace("bracket:foot")])
    model = fem.joined(structure, held)
    return fem.modes(model.K, model.M, N_MODES).frequency_hz


def limit() -> np.ndarray:
    """True frequencies [Hz], extrapolated with the power 2 lambda of the innermost element."""
    coarse, fine = map(frequencies, INNERMOST)
    return fine - (coarse - fine) / ((INNERMOST[0] / INNERMOST[1]) ** TWO_LAMBDA - 1)


def asked(scene: Scene, error: float, true: np.ndarray) -> tuple[int, float, float]:
    """Unknowns, error stated and largest true one of a mesh that an error is asked of."""
    found = search(scene.but(mesh={"error": error}))
    hz = found.solved["modes"].omega[:N_MODES] / (2 * np.pi)
    stated = found.adapted.stated
    return found.adapted.meshes[-1].unknowns, stated, float(np.max(hz / true - 1))


def even(scene: Scene, scale: float, true: np.ndarray) -> tuple[int, float]:
    """Unknowns and largest true error of a mesh of even elements."""
    scene = scene.but(mesh={"scale": scale, "error": None, "modes": None})
    solved = solved_on(scene, bodies.parts(scene))
    hz = solved.modes.omega[:N_MODES] / (2 * np.pi)
    return solved.model.K.shape[0], float(np.max(hz / true - 1))


def exponent(rows: list[tuple[int, float]]) -> float:
    """p of error ~ N^-p, on a line through the logarithms."""
    unknowns, errors = np.log(np.array(rows)).T
    return -float(np.polyfit(unknowns, errors, 1)[0])


def ideal(unknowns: list[int], of_edge: float) -> float:
    """Exponent of the best sizes of tetrahedra, between the fewest and the most unknowns."""
    angle = 1.5 * np.pi
    radius = np.sqrt(2 * (A * W + (B - W) * W) / angle)
    r = radius * np.geomspace(1e-6, 1, 800)

    def beyond(f: np.ndarray) -> np.ndarray:
        return -cumulative_trapezoid(f[::-1], r[::-1], initial=0.0)[::-1]

    n, errors = [], []  # of every kappa and, along r, every r0
    for kappa in np.geomspace(1e-3, 3, 300) * radius ** ((1 + TWO_LAMBDA) / 7):
        h = np.minimum(kappa * r ** ((6 - TWO_LAMBDA) / 7), r)
        n.append(DENSITY * T * angle * (beyond(r / h**3) + 1 / (2 * r)))
        errors.append(beyond(h**4 * r ** (TWO_LAMBDA - 5)) + of_edge * r**TWO_LAMBDA)
    ends = [(N, np.min(errors, where=np.array(n) <= N, initial=np.inf)) for N in unknowns]
    return exponent(ends)


def main(words: list[str]) -> dict[str, tuple[float, float]]:
    """Exponents of meshes with an error asked and of even ones, by element."""
    kinds = [word for word in words if word.isalpha()] or ["hex", "tet"]
    errors = [float(word) for word in words if not word.isalpha()] or ASKED
    true, exponents = limit(), {}
    print("true frequencies", *(f"{hz:.1f}" for hz in true), "Hz")
    for kind in kinds:
        scene, rows = bracket(kind), []
        for error in errors:
            unknowns, stated, largest = asked(scene, error, true)
            rows.append((unknowns, largest))
            print(f"{kind} asked {error:5.1%} {unknowns:6} stated {stated:6.2%} true {largest:.3%}")
        of_even = [even(scene, scale, true) for scale in SCALES]
        for scale, (unknowns, largest) in zip(SCALES, of_even, strict=True):
            print(f"{kind} scale {scale:5.1f} {unknowns:6} {'':13} true {largest:.3%}")
        # errors that the same mesh meets count once
        exponents[kind] = exponent([*dict.fromkeys(rows)]), exponent(of_even)
        print("{} exponents {:.2f}, of even elements {:.2f}".format(kind, *exponents[kind]))
        if kind == "tet":
            best = [ideal([n for n, _ in rows], of_edge) for of_edge in OF_EDGE]
            print("tet exponents of the best sizes {:.2f} to {:.2f}".format(*best))
    return exponents


if __name__ == "__main__":
    main(sys.argv[1:])
