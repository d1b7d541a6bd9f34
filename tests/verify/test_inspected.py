"""Numbers that `inspect` finds in records of an independent model, beside those that made them.

A chain of Hertz' contacts by scipy's DOP853 from Newton's law, at a mass on a spring and at a
hinged beam in closed form: w = W sin(k x), psi = Y cos(k x), k = j pi / L, of S. P. Timoshenko's
equations

    (kappa G A k^2 - rho A omega^2) W - kappa G A k Y = 0
    -kappa G A k W + (E I k^2 + kappa G A - rho I omega^2) Y = 0

The surface that is struck bulges by nu (2 h^2 + b^2) / 24 w'' (Timoshenko and Goodier, Theory of
Elasticity, sec. 102). No wall, no kernel and no reduction of ours is in them; white noise of a
fixed seed is added.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from beadwave import fem
from beadwave.workflows.evidence.harness import Comparison
from beadwave.workflows.files.record import Channel, MeanRecord
from beadwave.workflows.fit.inspect import InspectionRequest
from beadwave.workflows.fit.inspect import inspected as inspection
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.sweep.cases import base_of

Array = NDArray[np.float64]
NOISE = 3e-3  # of the largest signal
SAMPLING, DURATION = 1e6, 3e-3  # Hz, s
MASS = "a chain at a mass on a spring by DOP853 of scipy"
BEAM = "a chain at Timoshenko's hinged beam in closed form (Phil. Mag. 41 (1921) 744) by DOP853"
SCENE = {
    "chain": {"count": 6, "radius": 0.015, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.3},
    "time": {"duration": DURATION},
    "output": {"spheres": [4]},
}
AT_A_MASS = {
    "name": "at-a-mass",
    "wall": {"kind": "1dof", "frequency": 800.0, "mass": 0.5, "damping_ratio": 0.02,
             "young": 70e9, "poisson": 0.33},
}  # fmt: skip
AT_A_BEAM = {
    "name": "at-a-beam",
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.003},
    "beam": {"length": 0.3, "width": 0.04, "thickness": 0.012, "young": 70e9, "poisson": 0.33,
             "density": 2700.0, "left": "hinged", "right": "hinged", "position": 0.126},
}  # fmt: skip
FOURTH = 3  # of the spheres, counted from 0, that has the sensor


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tables", "truth"),
    [
        (AT_A_MASS, {"wall.frequency": 860.0, "wall.mass": 0.56}),
        (AT_A_BEAM, {"beam.thickness": 12.6e-3, "beam.young": 73.5e9}),
    ],
    ids=["at a mass", "at a beam"],
)
def test_inspect_finds_the_numbers_that_made_a_record(tables, truth, check, compare):
    scene = base_of(SCENE | tables, ())
    record = _record(scene.with_values(truth))
    request = InspectionRequest(",".join(truth), starts=4)
    fit = inspection(scene, (record,), request, quiet).answer.inversion
    # the fit's trigger and velocity come behind the keys that it was asked for
    for i, (key, true) in enumerate(truth.items()):
        name = f"{key} [{fit.parameters[i].unit}]"
        value, bar = float(fit.value[i]), float(fit.uncertainty.two_sigma[i])
        if tables is AT_A_BEAM:
            # one oscillator stands for the modes of our beam above 50 kHz, which moves
            # the force by 1e-3 rms here, modulus and thickness by 1.1e-3 and 5e-4: more than
            # their bars of 1.4e-4 and 1e-4.
            compare(name, value, true, allowed=3e-3, source=BEAM)
            continue
        # 1.5 bars of two sigma: three standard deviations, which 1 of 370 numbers exceeds
        off = abs(value - true) / bar
        check(Comparison(f"{name}, error in its bars", value, true, off, 1.5, MASS))
        # bars longer than 0.01 of a number would hold anything
        check(Comparison(f"{name}, its bar", bar, 0.0, bar / true, 0.01, MASS))


def _record(scene: Scene) -> MeanRecord:
    """The force that the fourth sphere shows, its first touch 20 us after the record begins."""
    # spheres: A = 4/3 E* sqrt(R*), the last contact with what is struck
    n, radius = scene.chain.count, scene.chain.radius
    mass = 4.0 / 3.0 * np.pi * radius**3 * scene.chain.density
    soft = (1.0 - scene.chain.poisson**2) / scene.chain.young  # 1 / E* of one side
    struck = scene.wall if scene.beam is None else scene.beam
    A = np.full(n, 4.0 / 3.0 * np.sqrt(radius / 2.0) / (2.0 * soft))
    A[-1] = 4.0 / 3.0 * np.sqrt(radius) / (soft + (1.0 - struck.poisson**2) / struck.young)

    # wall: omega [rad/s], zeta, and phi [kg^-1/2] at the contact, of a mass on a spring or a beam
    if scene.beam is None:
        omega, phi = np.array([2.0 * np.pi * struck.frequency]), np.array([struck.mass**-0.5])
        zeta = struck.damping_ratio
    else:
        omega, phi = hinged_timoshenko_modes(scene)
        zeta = scene.damping.ratio

    # m x'' = F_(i-1) - F_i,  q'' + 2 zeta omega q' + omega^2 q = phi F_n
    def forces(x, q):
        return A * np.maximum(x - np.append(x[1:], phi @ q), 0.0) ** 1.5

    def rate(_, y):
        x, v, q, p = np.split(y, np.cumsum([n, n, phi.size]))
        F = forces(x, q)
        acceleration = phi * F[-1] - 2.0 * zeta * omega * p - omega**2 * q
        return np.concatenate([v, (np.append(0.0, F[:-1]) - F) / mass, p, acceleration])

    t = np.arange(0.0, DURATION, 1.0 / SAMPLING)
    y0 = np.zeros(2 * n + 2 * phi.size)
    y0[n] = scene.striker.velocity
    unit = scene.striker.velocity * np.repeat([1e-4, 1.0, 1e-4, 1.0], [n, n, phi.size, phi.size])
    run = solve_ivp(rate, (0.0, t[-1]), y0, "DOP853", t, rtol=1e-8, atol=1e-8 * unit)
    F = np.array([forces(y[:n], y[2 * n : 2 * n + phi.size]) for y in run.y.T])

    # a sensor inside of a sphere shows the mean of the forces on both sides; white noise on it
    before_touch = np.zeros(round(20e-6 * SAMPLING))
    signal = np.append(before_touch, F[:, FOURTH - 1 : FOURTH + 1].mean(axis=1))
    rms = NOISE * signal.max()
    noisy = signal + rms * np.random.default_rng(1).standard_normal(signal.size)
    t = np.arange(signal.size) / SAMPLING
    channel = Channel(FOURTH + 1, "force", False)
    return MeanRecord(t, noisy[:, None], (channel,), np.full(1, np.nan), 1, scene.name, True)


def hinged_timoshenko_modes(scene: Scene) -> tuple[Array, Array]:
    """omega (n,) [rad/s] and phi (n,) = W sin(k p) cos(k e) of modes with
    L / 2 (rho A W^2 + rho I Y^2) = 1: a bent section bulges by e^2 / 2 = nu (2 h^2 + b^2) / 24
    times the curvature where it is struck. The shear factor is the section's, compared elsewhere
    with three-dimensional elasticity."""
    b = scene.beam
    area, second = b.width * b.thickness, b.width * b.thickness**3 / 12.0
    kappa = fem.rectangle(b.width, b.thickness, b.poisson).shear_factor
    e = np.sqrt(b.poisson * (2.0 * b.thickness**2 + b.width**2) / 12.0)
    shear = kappa * area * b.young / (2.0 * (1.0 + b.poisson))
    M = 0.5 * b.length * b.density * np.diag([area, second])
    modes = []
    # 25 waves along the beam, two modes each
    for k in np.arange(1, 26) * np.pi / b.length:
        K = np.array([[shear * k**2, -shear * k], [-shear * k, b.young * second * k**2 + shear]])
        squares, shapes = eigh(0.5 * b.length * K, M)
        bulged = np.cos(k * e) * np.sin(k * b.position)
        modes += zip(np.sqrt(squares), shapes[0] * bulged, strict=True)
    omega, phi = np.array(modes).T
    return omega, phi
