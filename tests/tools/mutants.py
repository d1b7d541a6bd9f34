"""Mutants of the numerical modules: small errors, one at a time, that the tests should notice.

    python tests/tools/mutants.py [ROOM|MODULE ...] [COUNT] [SEED]

Draws COUNT mutants (20) of each room below, all alike likely, and runs the tests that call the
changed function, the quickest first, up to the first that fails. The tests that a room names are
run once without a mutant, to see what each of them calls and how long it takes; those marked slow
are left out. A mutant whose tests all pass has survived, unless EXPLAINED says why none can notice
it. Prints each with its line, before and after, and the share that was noticed of all that are not
explained. Kernels are mutated as plain Python: the same errors, and nothing to compile.
"""

import ast
import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from multiprocessing import get_context
from pathlib import Path
from random import Random
from resource import RLIMIT_CPU, setrlimit
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "beadwave"  # where the imported modules say that they are
FIT = "workflows/fit/"
FITS = ("fit/fit", "fit/sensed", "fit/target", "fit/posterior",
        "fit/inspected", "fit/inspection", "fit/calibration")  # fmt: skip
QUICK = "not (slow or peer or minutes)"
# tests that call them compiled, which as plain Python would take an hour: compiled anew for each
# mutant, and tried by every test of the room, as what compiled functions call cannot be seen
COMPILED = ("dem/space/kernel.py", "dem/kernels/tangential.py")
LOADED = ("numba", "scipy.optimize", "scipy.signal", "scipy.sparse.linalg", "skfem")


class Room(NamedTuple):
    """Modules that are mutated together, and the files of tests that may notice."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS = {
    "kernels": Room(
        ("dem/kernels/laws.py", "dem/kernels/explicit.py", "dem/kernels/events.py",
         "dem/kernels/implicit.py", "dem/kernels/dense.py", "dem/kernels/passages.py",
         "dem/kernels/equilibrium.py", "dem/kernels/ledger.py",
         "dem/kernels/modes.py", "dem/kernels/oscillators.py", "dem/kernels/ends.py",
         "dem/kernels/between.py", "dem/kernels/lanes.py", "dem/kernels/sensitivities.py"),
        ("dem/kernels", "dem/ends", "dem/lanes", "dem/sensitivities"),
    ),
    "reduction": Room(
        ("rom/craig_bampton.py", "rom/fixed_interface.py", "rom/free_modes.py",
         "rom/contact_modes.py", "rom/lanczos.py", "rom/truncation.py", "rom/reduced_model.py",
         "rom/floating.py", "rom/factorisation.py", "rom/residual_vector.py", "rom/health.py"),
        ("rom/reduced_model", "rom/parts", "rom/reduction", "rom/health"),
    ),
    "joints": Room(
        ("fem/assembly/joints.py", "fem/assembly/constraints.py", "fem/contact/contact_patch.py"),
        ("fem/joints", "fem/contact_patch", "fem/mechanisms", "fem/half_space"),
    ),
    "coupling": Room(
        ("coupling/reduced_wall.py", "coupling/damping.py", "coupling/coupled_march.py",
         "coupling/verdict.py", "workflows/fit/parametric_wall.py",
         "coupling/band.py", "coupling/sensors.py",
         "coupling/elliptical_contact.py", "coupling/radiation.py"),
        ("coupling/damping", "coupling/verdict", "fit/parametric_wall", "coupling/sensors",
         "coupling/elliptical", "coupling/radiation"),
    ),
    "calibration": Room(
        (FIT + "least_squares.py", FIT + "uncertainty.py", FIT + "parameter.py",
         FIT + "aligned_signals.py", FIT + "forward.py", FIT + "sensed.py",
         FIT + "scaling.py", FIT + "posterior.py", FIT + "windows.py"),
        FITS,
    ),
    "inspection": Room(
        (FIT + "least_squares.py", FIT + "uncertainty.py", FIT + "inversion.py"),
        FITS,
    ),
    "space": Room(
        ("dem/space/lattices.py", "dem/space/linear.py", "dem/space/march.py",
         "dem/space/packing.py", "dem/space/rows.py", "dem/space/statics.py",
         "dem/space/structure.py", "dem/space/waves.py", "dem/friction.py"),
        ("dem/space", "dem/space_friction", "dem/space_rows", "dem/space_structure",
         "dem/friction"),
    ),
    "space_kernel": Room(
        COMPILED,
        ("dem/space", "dem/space_friction", "dem/space_rows", "dem/space_structure",
         "dem/friction"),
    ),
    "waves": Room(
        ("dem/waves/arrivals.py", "dem/waves/chain_waves.py", "dem/waves/fit.py",
         "dem/waves/labels.py", "dem/waves/measures.py", "dem/waves/solitary.py",
         "dem/waves/tracks.py"),
        ("dem/waves",),
    ),
    "contact": Room(
        ("fem/contact/anisotropic_half_space.py", "fem/contact/bolted_joint.py",
         "fem/contact/coulomb_friction.py", "fem/contact/disc_room.py",
         "fem/contact/facing_facets.py", "fem/contact/further_states.py",
         "fem/contact/half_space.py", "fem/contact/impact_point.py",
         "fem/contact/joint_bounds.py", "fem/contact/modal_backbone.py",
         "fem/contact/preloaded_contact.py", "fem/contact/pressed_model.py",
         "fem/contact/round_face.py"),
        ("fem/preloaded_contact", "fem/bolted_joint", "fem/curved_contact", "fem/modal_backbone",
         "fem/half_space", "fem/anisotropic_half_space", "fem/strike", "fem/chord_height"),
    ),
    "errors": Room(
        ("fem/errors/stress_error.py", "fem/errors/optimal_sizes.py", "fem/errors/left_out.py",
         "workflows/stages/errors/adapted_sizes.py"),
        ("fem/stress_error", "fem/optimal_sizes", "fem/left_out", "workflows/adapted_sizes"),
    ),
    "updating": Room(
        ("fem/modes/assembly_modes.py", "fem/modes/mac.py", "fem/modes/mode_field.py",
         "fem/modes/modes.py", "fem/updating/identifiability.py", "fem/updating/loss_factors.py",
         "fem/updating/response_fit.py", "fem/updating/response_model.py",
         "fem/updating/tuning.py"),
        ("fem/mac", "fem/identifiability", "fem/responses", "fem/tuning", "fem/theory",
         "fem/factorisation"),
    ),
    "identification": Room(
        ("fem/identification/decay.py", "fem/identification/distortion.py",
         "fem/identification/half_power.py", "fem/identification/hammer_test.py",
         "fem/identification/hit_records.py", "fem/identification/hits.py",
         "fem/identification/measured_shapes.py", "fem/identification/poly_reference.py",
         "fem/identification/response_scale.py", "fem/identification/sensor_placement.py",
         "fem/identification/subspace.py", "fem/identification/synthetic_hits.py"),
        ("fem/decay", "fem/distortion", "fem/half_power", "fem/hammer", "fem/hits",
         "fem/response_scale", "fem/sensor_placement", "fem/subspace"),
    ),
    "shaken": Room(
        ("coupling/continuation.py", "coupling/harmonic_balance.py",
         "coupling/modes_at_amplitude.py", "coupling/period_map.py",
         "coupling/periodic_state.py", "coupling/shaken_march.py", "coupling/shaken_packing.py"),
        ("coupling/continuation", "coupling/harmonic_balance", "coupling/modes_at_amplitude",
         "coupling/shaken", "coupling/shaken_packing"),
    ),
    "meshing": Room(
        ("geometry/meshing/curved_faces.py", "geometry/meshing/grid_lines.py",
         "geometry/meshing/lined_blocks.py", "geometry/meshing/node_estimate.py",
         "geometry/meshing/size_field.py", "geometry/meshing/sizes.py",
         "geometry/own_mesh/curved.py"),
        ("geometry/curved_faces", "geometry/meshes", "geometry/size_field"),
    ),
    "passive": Room(("rom/passive_fit.py",), ("rom/passive_fit", "rom/passive_matrix")),
}  # fmt: skip
LONGEST = 6.0  # [s] of a test: longer ones, left out, could only notice more
SAME = "an equal number is met by chance only"
UNREAD = "the number is not read"
START = "where a search begins; its end does not depend on it"
FAR = "a tolerance that lies far from what it tells apart"
WORDS = "digits in the words of an error"
RESHAPED = "numpy takes any negative number for what remains"
CONJUGATE = "the conjugate has the same size"
WHOLE = "a count is a whole number"
RATIOS = "ratios alone are read"
SQUARE = "K is square"
SLOWER = "another way to the same numbers"
WEIGHTS = "weights say which of several sound choices is taken"
SHARED = "how much of an error each of its two parts may have"
FLAG = "true, or false, either way: a flag that numba takes for no literal"
CREST = "a crest is above what is before it"
LOOKS = "when a search looks whether it may end; what it has found by then does not depend on it"


def _parts_of(line: str) -> list[str]:
    """Every expression of a line."""
    return [ast.unparse(node) for node in ast.walk(ast.parse(line)) if isinstance(node, ast.expr)]


EXPLAINED = {  # line, expression: why no test can notice its mutants
    ("if e > 0.0:", "0.0"): START,
    ("if sign * v[i] > sign * v[k]:", "sign * v[i] > sign * v[k]"): SAME,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)", "0.001"): START,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)", "0.23"): START,
    ("if next_omega <= s[-1] or first <= 0:", "next_omega <= s[-1]"): SAME,
    ("n_modes = min(2 * n_modes, options.most_rigid, n)", "2"): SLOWER,
    ("start = np.random.default_rng(1).standard_normal((M.shape[0], options.block))", "1"): START,
    ("return _errors(problem, w, static, rigid, pairs, to_hz).min() <= error",
     "_errors(problem, w, static, rigid, pairs, to_hz).min() <= error"): SAME,
    ("if error is None or reduced.error <= error:", "reduced.error <= error"): SAME,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)", "1.3"): START,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)", "1.05"): START,
    ("if next_omega <= s[-1] or first <= 0:", "first <= 0"):
        "what is missed of nothing is set to 0",
    ("moved = np.abs(wall.phi) > 1e-9 * np.abs(wall.phi).max()", "1e-09"): FAR,
    ("if n > 5000:", "n > 5000"): "dense matrices of that size are too large for a test",
    ("if n > 5000:", "5000"): "dense matrices of that size are too large for a test",
    ("x = np.random.default_rng(0).standard_normal(K.shape[0])", "0"): START,
    ("for _ in range(2):", "2"): "what is made orthogonal once more changes by rounding alone",
    ("if exhausted or step % options.check == 0:", "0"): LOOKS,
    ("if exhausted or step % options.check == 0:", "step % options.check == 0"): LOOKS,
    ("omega, phi = modes_until(problem, lambda omega, _: len(omega) >= n_modes, options)",
     "len(omega) >= n_modes"): LOOKS,
    ("scale = np.sqrt(np.maximum(np.diag(gram), (1e-13 * norm) ** 2 + np.finfo(float).tiny))",
     "(1e-13 * norm) ** 2 + np.finfo(float).tiny"): "keeps from 0 / 0 what no structure has",
    ("independent &= np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2", "1e-13"): FAR,
    ("if len(A) >= 600:  # coordinates, above which all eigenvalues take a second",
     "len(A) >= 600"): SAME,
    ("scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))", "1"): RATIOS,
    ("return (A + A.T) / 2 * np.outer(scale, scale)", "2"): RATIOS,
    ("return (A + A.T) / 2 * np.outer(scale, scale)", "(A + A.T) / 2"): RATIOS,
    ("return max(1, int(np.count_nonzero(omega > (1 + 1e-9) * limit)))",
     "omega > (1 + 1e-09) * limit"): SAME,
    ("if reciprocal_condition < EPS:", "reciprocal_condition < EPS"): SAME,
    ("moved = wall.phi / (wall.omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)",
     "1 + 1j * LOSS"): CONJUGATE,
    ("if highest <= 2 * np.pi * to_hz:", "highest <= 2 * np.pi * to_hz"): SAME,
    ("for _ in range(2):  # once leaves rounding over the smallest size", "2"):
        "what is made orthogonal once more changes by rounding alone",
    ("if omega.max(initial=0) < 2 * np.pi * to_hz:",
     "omega.max(initial=0) < 2 * np.pi * to_hz"): LOOKS,
    ("if omega.max(initial=0) < 2 * np.pi * to_hz:", "2 * np.pi * to_hz"): LOOKS,
    ("if omega.max(initial=0) < 2 * np.pi * to_hz:", "2 * np.pi"): LOOKS,
    ("if omega.max(initial=0) < 2 * np.pi * to_hz:", "2"): LOOKS,
    ("if omega.max(initial=0) < 2 * np.pi * to_hz:", "0"): LOOKS,
    ("if errors.min() > error:", "errors.min() > error"): SAME,
    ("n_modes = int(np.argmax(errors <= error))", "errors <= error"): SAME,
    ("n_modes = max(int(np.argmax(errors <= error)), n_retained)", "errors <= error"): SAME,
    ("if problem.sigma == 0:", "0"): SLOWER,
    ("return np.zeros((problem.K.shape[0], 0))", "0"): SQUARE,
    ("if w @ r <= 1e-14 * compliance:", "w @ r <= 1e-14 * compliance"): SAME,
    ("if w @ r <= 1e-14 * compliance:", "1e-14"): FAR,
    ("n_vectors = 0 if n_modes is None else n_modes + 1 - n_retained", "0"): LOOKS,
    ("return max(1, int(np.count_nonzero(omega > (1 + 1e-9) * limit)))", "1e-09"): FAR,
    ("omega = np.append(retained.omega, 1 / np.sqrt(inverse_squared))", "1"):
        "its order alone is read",
    ("n = problem.K.shape[0]", "0"): SQUARE,
    ("n = K.shape[0]", "0"): SQUARE,
    ("omega, phi = modes_until(problem, lambda omega, _: omega.max(initial=0) >= cutoff)",
     "omega.max(initial=0) >= cutoff"): LOOKS,
    ("below = np.count_nonzero(omega < cutoff)", "omega < cutoff"): SAME,
    ("if K.shape[0] <= options.dense:", "K.shape[0] <= options.dense"): SLOWER,
    ("if K.shape[0] <= options.dense:", "0"): SQUARE,
    ("start = np.random.default_rng(1).standard_normal((M.shape[0], options.block))", "0"): SQUARE,
    ("if block.shape[1] < options.block:", "block.shape[1] < options.block"): START,
    ("for step in count(1):", "1"): LOOKS,
    ("n = int(np.argmax(np.append(residual > options.converged * np.abs(theta), True)))",
     "residual > options.converged * np.abs(theta)"): SAME,
    ("scale = np.sqrt(np.maximum(np.diag(gram), (1e-13 * norm) ** 2 + np.finfo(float).tiny))",
     "1e-13"): FAR,
    ("scale = np.sqrt(np.maximum(np.diag(gram), (1e-13 * norm) ** 2 + np.finfo(float).tiny))",
     "2"): FAR,
    ("independent = size > 1e-12", "size > 1e-12"): SAME,
    ("independent = size > 1e-12", "1e-12"): FAR,
    ("independent &= np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2",
     "np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2"): SAME,
    ("independent &= np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2", "2"): FAR,
    ("W, norm = W @ turn, 0.0", "0.0"): FAR,
    ("if coupling > 1e-7:", "coupling > 1e-07"): SAME,
    ("omega = np.sqrt(np.where(squared > rounding, squared, 0.0))", "squared > rounding"): SAME,
    ("if squared[0] < -rounding:", "squared[0] < -rounding"): SAME,
    ("return np.where(beyond[0] < 1e-12 * beyond[0][0], 0.0, np.array(missing) / scale)",
     "beyond[0] < 1e-12 * beyond[0][0]"): SAME,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)",
     "to_hz * max(1.05, 1.3 * (0.001 / error) ** 0.23)"): START,
    ("return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)", "0.001 / error"): START,
    ("scale = 1 / np.sqrt(stiffness)", "1"): RATIOS,
    ("norm = float(np.abs(scaled).sum(axis=0).max())", "0"): "K is symmetric",
    ("if inverse_squared[0] <= 10 * EPS * inverse_squared[-1]:", "10"): FAR,
    ("noise = 20 * EPS * max(squared[-1], 0.0)", "20"): FAR,
    ("scale = 1 / np.sqrt(np.diag(reduced.K))", "1"): RATIOS,
    ("if squared[0] < -noise:", "squared[0] < -noise"): SAME,
    ("return np.sqrt(np.where(squared > noise, squared, 0.0)), V", "squared > noise"): SAME,
    ("if inverse_squared[0] <= 10 * EPS * inverse_squared[-1]:",
     "inverse_squared[0] <= 10 * EPS * inverse_squared[-1]"): SAME,
    ("for _ in range(3):", "3"): FAR,
    ("if asymmetry > 1e-9:", "asymmetry > 1e-09"): SAME,
    ("u, p, rho = np.zeros_like(r), np.zeros_like(r), 1.0", "1.0"): UNREAD,
    ("for _ in range(200):", "200"): FAR,
    ("enough = 1e-22 * rho if enough is None else enough  # squares: 1e-11 of the first residual",
     "1e-22"): FAR,
    ("if lowest < len(reduced.w) * EPS:", "lowest < len(reduced.w) * EPS"): SAME,
    ("start = np.random.default_rng(0).standard_normal(len(A))", "0"): START,
    ("q = np.random.default_rng(2).standard_normal(len(reduced.w))", "2"): START,
    ("if mismatch > 1e-6:", "mismatch > 1e-06"): SAME,
    ("if mismatch > allowed:", "mismatch > allowed"): SAME,
    ('options = {"which": "LM", "v0": start, "tol": 1e-3, "return_eigenvectors": False}',
     "0.001"): FAR,
    ("return np.where(beyond[0] < 1e-12 * beyond[0][0], 0.0, np.array(missing) / scale)",
     "1e-12"): FAR,
    ("Z = turned(Z, U[:, size > 1e-12] / np.sqrt(size[size > 1e-12]))", "size > 1e-12"): SAME,
    ("Z = turned(Z, U[:, size > 1e-12] / np.sqrt(size[size > 1e-12]))", "1e-12"): FAR,
    ("order = order[pairs.omega[order] < 2 * np.pi * cutoff_hz]",
     "pairs.omega[order] < 2 * np.pi * cutoff_hz"): SAME,
    ("return G.reshape(-1, 6)", "1"): RESHAPED,
    ("first = np.eye(3)[np.flatnonzero(np.abs(z) < 0.9)[0]]", "np.abs(z) < 0.9"): SAME,
    ("size = np.abs(G[:, 3:]).max(initial=1e-300)", "3"): FAR,
    ("size = np.abs(G[:, 3:]).max(initial=1e-300)", "1e-300"): FAR,
    ("nodes.append(dofs[radii <= coupling.side.within * (1 + 1e-9)])", "1e-09"): FAR,
    ("inside = np.linalg.norm(points - coupling.centre, axis=1) <= side.within * (1 + 1e-9)",
     "np.linalg.norm(points - coupling.centre, axis=1) <= side.within * (1 + 1e-09)"): SAME,
    ("inside = np.linalg.norm(points - coupling.centre, axis=1) <= side.within * (1 + 1e-9)",
     "1e-09"): FAR,
    ("weight = np.where(np.isin(columns, spare), last, 1.0 * (columns < structure.n_dofs))",
     "1.0"): WEIGHTS,
    ("A *= np.tile([1.0] * 3 + [size] * 3, len(sides))[:, None]", "1.0"): WEIGHTS,
    ("size = np.ptp(structure.points[used // 3], axis=0).max()", "3"): WEIGHTS,
    ("size = np.ptp(structure.points[used // 3], axis=0).max()", "0"): WEIGHTS,
    ("if not diagonal[-1] > last**2 * diagonal[0]:", "last ** 2 * diagonal[0]"): FAR,
    ("if not diagonal[-1] > last**2 * diagonal[0]:", "2"): FAR,
    ('place = f"{np.round(at.point, 6).tolist()} m"', "6"): WORDS,
    ("return D is not None and modal_coupling(D) > UNCOUPLED",
     "modal_coupling(D) > UNCOUPLED"): SAME,
    ("duration = max(self.duration - (self.signals.t[-1] - t[-1]), 4 * self.dt)",
     "self.duration - (self.signals.t[-1] - t[-1])"): "a longer march begins alike",
    ("duration = max(self.duration - (self.signals.t[-1] - t[-1]), 4 * self.dt)", "-1"):
     "a longer march begins alike",
    ("T = reduced.surface.T.reshape(-1, reduced.surface.T.shape[-1])", "-1"):
     "the last axis of a matrix is its second",
    ("powers = product(range(degree + 1), repeat=len(box.low))", "1"):
     "higher powers are left out after that",
    ("return (first.T @ second) ** 2 / np.maximum(square, 1e-300)", "1e-300"): FAR,
    ("return np.where(self._by_factors, np.exp(np.where(self._by_factors, x, 0.0)), x)", "0.0"):
     UNREAD,
    ("return np.where(self._by_factors, np.log(np.where(self._by_factors, value, 1.0)), value)",
     "1.0"): UNREAD,
    ("if a >= 0.0:", "a >= 0.0"): SAME,
    ("return 1 / max(fastest, decay / 3) if fastest > 0 else np.inf", "fastest > 0"):
     "dampers of a wall without stiffness are refused before, 1 / 0 is infinite as well",
    ("moving = (g * h != 0) & (wall.omega > 0)", "wall.omega > 0"):
     "free modes add 1 / inf",
    ("largest = energies[0][0] or np.abs(total).max() or 1.0", "1.0"):
     "of no energy none is missed",
    ("tolerance = max(error, 1e-13)", "1e-13"): FAR,
    ("if ratio < 1 + 1e-6:", "ratio < 1 + 1e-06"): SAME,
    ("s = brentq(rayleigh, 1 + 1e-12, 3, xtol=1e-14)", "1e-12"): START,
    ("shared = np.sqrt(k[:-1] * k[1:]) * inverse[: len(k)][1:] if len(k) > 1 else np.zeros(0)",
     "len(k) > 1"): "of one contact the products are none as well",
    ("wall_force[lane] = elastic_force(last + lane, d if d > 0.0 else 0.0, lanes.A, shape)",
     "d > 0.0"): SAME,
    ("f[j + LANES] = elastic_force(j, d if d > 0.0 else 0.0, A, shape)", "d > 0.0"): SAME,
    ("d = d if d > 0.0 else 0.0", "d > 0.0"): SAME,
    ("pulls = 1.0 if c * w + f[j + LANES] < 0.0 else 0.0", "c * w + f[j + LANES] < 0.0"): SAME,
    ("step = -value / slope if slope != 0.0 else 2.0", "2.0"): "steps out of the bracket halve it",
    ("if abs(change) <= 1e-15 * z:", "abs(change) <= 1e-15 * z"): LOOKS,
    ("for _ in range(60):", "60"): "a root takes fewer",
    ("for _ in range(100):", "100"): "a root takes fewer",
    ("if lanes.springs.residual.size > 0 or lanes.damping.gamma.size > 0:",
     "lanes.springs.residual.size > 0"): "without either the forces stay",
    ("if lanes.springs.residual.size > 0 or lanes.damping.gamma.size > 0:",
     "lanes.damping.gamma.size > 0"): "without either the forces stay",
    ("possible=bool(force < limit) and (passive or isinstance(wall, CoupledWall)),",
     "force < limit"): SAME,
    ("if not force < limit:", "force < limit"): SAME,
    ("if residual >= 0:", "residual >= 0"): "a spring of 0 has an infinite force either way",
    ("if alpha < 0 or beta < 0:", "alpha < 0"): SAME,
    ("if alpha < 0 or beta < 0:", "beta < 0"): SAME,
    ("zeta = np.where(omega > 0, alpha / (2 * omega) + beta * omega / 2, 0.0)", "0.0"):
     "ratios of rigid motion are set to 0 after that",
    ("return (self.low > 0) & (self.high > FACTORS * self.low)",
     "self.high > FACTORS * self.low"): SAME,
    ("if squares.min(initial=np.inf) < -RIGID * squares.max(initial=0.0):",
     "squares.min(initial=np.inf) < -RIGID * squares.max(initial=0.0)"): SAME,
    ("step = np.where(range_ > 0, range_, 1.0) / 2.0 ** (bits - 1)", "1.0"): UNREAD,
    ("swap = self.fit.solved(z, free, window, max_runs=8, prior=prior, tolerance=1e-4)", "8"):
     "a trial may take a run more",
    ("step = self.fit.solved(z, free, window, max_runs=8, prior=prior, tolerance=1e-4)", "8"):
     "a window may take a run more",
    ("share = 1.0 / 40320.0 - z * (1.0 / 362880.0 - z * (1.0 / 3628800.0))", "3628800.0"):
     "of the last term, near rounding",
    ("if abs(record[k]) >= level:", "abs(record[k]) >= level"): SAME,
    ("log = np.log(np.maximum(omega, 1e-300) / (2 * np.pi))", "1e-300"): FAR,
    ("blind = np.sqrt((Vt[~determined] ** 2).sum(axis=0)) > 1e-6",
     "np.sqrt((Vt[~determined] ** 2).sum(axis=0)) > 1e-06"): SAME,
    ("alike = correlation >= ALIKE_CORRELATION", "correlation >= ALIKE_CORRELATION"): SAME,
    ("calm = slope < CALM_SLOPE * slope.max()", "slope < CALM_SLOPE * slope.max()"): SAME,
    ("blind = np.sqrt((Vt[~determined] ** 2).sum(axis=0)) > 1e-6", "1e-06"): FAR,
    ("w = contact_functional(w, K.shape[0])", "0"): SQUARE,
    ("determined = s > 1e-12 * s.max(initial=0.0)", "1e-12"): FAR,
    ("determined = s > 1e-12 * s.max(initial=0.0)", "s > 1e-12 * s.max(initial=0.0)"): SAME,
    ("return (lag - 2 * k if lag >= k else lag) * (t[1] - t[0])", "lag >= k"): SAME,
    ("margin = MARGIN * (high - low)", "MARGIN * (high - low)"): FAR,
    ("margin = MARGIN * (high - low)", "high - low"): FAR,
    ("alike = correlation > -2.0  # all but those that have none", "correlation > -2.0"): FAR,
    ("alike = correlation > -2.0  # all but those that have none", "2.0"): FAR,
    ('calm = np.convolve(calm, np.ones(5 * q), mode="valid") > 5 * q - 0.5',
     "np.convolve(calm, np.ones(5 * q), mode='valid') > 5 * q - 0.5"): WHOLE,
    ('calm = np.convolve(calm, np.ones(5 * q), mode="valid") > 5 * q - 0.5', "0.5"): WHOLE,
    ('calm = np.convolve(quiet, np.ones(width), mode="valid") >= width - 0.5', "0.5"): WHOLE,
    ("arrived = np.flatnonzero(column < -REFLECTED_PEAK * np.abs(column).max())",
     "column < -REFLECTED_PEAK * np.abs(column).max()"): SAME,
    ("q = max(1, len(t) // N_CHANGES)", "1"):
     "changes over two samples lie where those over one do",
    ("return np.isfinite(margin) & ((value - low <= margin) | (high - value <= margin))",
     "value - low <= margin"): SAME,
    ("return np.isfinite(margin) & ((value - low <= margin) | (high - value <= margin))",
     "high - value <= margin"): SAME,
    ("if available <= 1.0:", "available <= 1.0"): SAME,
    ("return bool((np.abs(self.value - other.value) > bars)[:n_shared].any())",
     "np.abs(self.value - other.value) > bars"): SAME,
    ("if max(factors) == 1.0:", "1.0"): "bars that are once as long stay",
    ("while rise < enough and t < available:", "rise < enough"): SAME,
    ("while rise < enough and t < available:", "t < available"): SAME,
    ("if rise < enough:", "rise < enough"): SAME,
    ("if lanes.q.size > 0:", "lanes.q.size > 0"): SLOWER,
    ("for lane in range(LANES if q.size > 0 else 0):", "q.size > 0"): SLOWER,
    ("if row + LANES == lanes.A.size and lanes.q.size > 0:", "lanes.q.size > 0"): SLOWER,
    ("root = math.sqrt(max(x[lane] - x[lane + LANES], NO_GAP))", "lane + LANES"): START,
    ("if touching == 0.0:", "0.0"): SLOWER,
    ("beyond = 3.0 * gap >= fold[lane] * fold[lane]", "3.0 * gap >= fold[lane] * fold[lane]"): SAME,
    ("f[lane] = math.nan if beyond else force if gap > 0.0 else 0.0", "gap > 0.0"): SAME,
    ("if total == 0.0:", "0.0"): SLOWER,
    ("stale = n_save >= 0  # a literal True would compile what takes it once more",
     "n_save >= 0"): FLAG,
    ("stale = n_save >= 0  # a literal True would compile what takes it once more", "0"): FLAG,
    ("return observed.size < 0", "observed.size < 0"): FLAG,
    ("return observed.size < 0", "0"): FLAG,
    ("if p > 0:", "p > 0"): SLOWER,
    ("previous = slope[i - 1] if i > 0 else 0.0", "i > 0"): "behind the last contact it is 0",
    ("newton_step(bearing.stiffness, k, r, floor * (norm / start), diagonal, change)",
     "norm / start"): SLOWER,
    ("if share * largest(change, None) > rounding:", "share * largest(change, None)"): LOOKS,
    ("nodes, weights = np.polynomial.legendre.leggauss(12)", "12"): FAR,
    ("force = elastic_force(i, d if d > 0.0 else 0.0, A, shape)", "d > 0.0"): SAME,
    ("f[i + 1] = elastic_force(i, d if d > 0.0 else 0.0, A, shape)", "d > 0.0"): SAME,
    ("if c == 0.0:", "0.0"): SLOWER,
    ("if share > 0.0:", "share > 0.0"): SAME,
    ("if fall > 0.0:", "fall > 0.0"): SAME,
    ("if g0 <= 0.0 and g1 > 0.0:", "g1 > 0.0"): SAME,
    ("if curvature >= 0.0:", "curvature >= 0.0"): CREST,
    ("if curvature >= 0.0:", "0.0"): CREST,
    ("return float(k), sign * y1", "sign * y1"): CREST,
    ("if k > 0 and sign_now != sign:", "k > 0"): "before the first run there is none",
    ("if k > 0 and sign_now != sign:", "0"): "a crest at an end of the record is none",
    ("sign_now = 2.0  # unlike any sign, ends the last run", "2.0"):
        "any number but a sign ends the last run",
    ("if not largest > 0.0:", "largest > 0.0"): SLOWER,
    ("if abs(z) < 1e-3:", "abs(z) < 0.001"): SAME,
    ("if abs(z) < 1e-3:", "0.001"): FAR,
    ("sign = 1.0 if square > 0.0 else -1.0", "square > 0.0"): SAME,
    ("elif square > 0.0:", "square > 0.0"): SAME,
    ("slow = omega * np.maximum(zeta, 1.0) * abs(t) < 1.0",
     "omega * np.maximum(zeta, 1.0) * abs(t) < 1.0"): SAME,
    ("closed = (1.0 - oscillator_propagator(omega, zeta, t)[0]) / np.where(slow, 1.0, omega) ** 2",
     "1.0"): UNREAD,
    ("if abs(change) <= 1e-15 * y:", "abs(change) <= 1e-15 * y"): LOOKS,
    ("if abs(change) <= 1e-15 * y:", "1e-15"): LOOKS,
    ("if abs(change) <= 1e-15 * z:", "1e-15"): LOOKS,
    ("if abs(z) < 0.02:  # expm1(-z) / z, where c may be too small to divide by",
     "abs(z) < 0.02"): SAME,
    ("if abs(z) < 0.02:  # expm1(-z) / z, where c may be too small to divide by", "0.02"): FAR,
    ("if abs(step) < 1e-13:", "abs(step) < 1e-13"): LOOKS,
    ("if abs(step) < 1e-13:", "1e-13"): LOOKS,
    ("if not low <= t <= high:", "low <= t <= high"): SAME,
    ("if d > plastic.top[i]:", "d > plastic.top[i]"): SAME,
    ("if top > plastic.top[i]:", "top > plastic.top[i]"): SAME,
    ("if until >= dt:", "until >= dt"): SAME,
    ("for _halving in range(40):", "40"): FAR,
    ("if 3.0 * gap >= top * top:", "3.0 * gap >= top * top"): SAME,
    ("if min(back) > 1 / 6:", "min(back) > 1 / 6"): SAME,
    ("1 / 3", "1 / 3"): START,
    ("along, across = 1.0, 0.0", "1.0"): "a spring that slips unsheared has no bound, and no heat",
    ("if bound > 0.0 and b > 0.0:", "bound > 0.0"): "where the bound was 0 nothing lies across",
    ("u, state = np.tile(u, (m, 1, 1)), np.tile(state, (m, 1))", "1"):
     "more cells than are asked for, or numbers that are not read",
    ("for _ in range(2):  # once leaves rounding of the size of X", "2"):
        "what is made orthogonal once more changes by rounding alone",
    ("if k < 20 * ends:", "k < 20 * ends"): SAME,
    ("inverse = np.where(sizes > 1e-12 * sizes[0], 1 / np.maximum(sizes, 1e-300), 0.0)", "0"): FAR,
} | {  # how many numbers of lanes there are
    (line, "0"): "there are none, or a register full"
    for line in (
        "if springs.residual.size > 0:",
        "if lanes.q.size > 0:",
        "for lane in range(LANES if q.size > 0 else 0):",
        "if row + LANES == lanes.A.size and lanes.q.size > 0:",
        "if lanes.damping.gamma.size > 0:",
        "if lanes.swing.shape[2] > 0:",
        "if resting.load.size > 0:",
        "if resting.stiffness.size > 0:",
        "if residual.size > 0:",
        "if damping.gamma.size > 0 and force > 0.0:",
        "if damping.gamma.size > 0 and grows(damping.law):",
        "if lanes.springs.residual.size > 0 or lanes.damping.gamma.size > 0:",
        "forces = np.zeros_like(lanes.f) if lanes.damping.gamma.size > 0 else lanes.f",
        "if resting.wall_offset.size > 0:",
    )
} | {  # of a line that only says where a search begins: all of it
    (line, before): START
    for line in (
        "z = 1.0 / y + 0.5 * mobility * A * dt / (1.0 + 1.5 * e * y)",
        "f[lane] = root / math.sqrt(max(1.0 + s[lane] * A[lane] * root, 1.0 / 3.0))",
    )
    for before in _parts_of(line)
}  # fmt: skip
SWAPS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.LtE,
    ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And, ast.USub: ast.UAdd, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip


class Mutant(NamedTuple):
    """The syntax of a module with one small error; its function, line, text, before and after."""

    module: str
    tree: ast.Module
    function: str
    line: int
    text: str
    before: str
    after: str

    @property
    def reason(self) -> str | None:
        """Reason why no test can notice it, if that is known."""
        return EXPLAINED.get((self.text, self.before))


def size(module: str) -> int:
    """Number of mutants of a module."""
    return sum(1 for _ in _places(ast.parse((ROOT / module).read_text())))


def mutant_of(module: str, i: int) -> Mutant:
    """The i-th mutant of a module, in the order of its syntax."""
    source = (ROOT / module).read_text()
    tree = ast.parse(source)
    function, node, change = [*_places(tree)][i]
    text, before = source.splitlines()[node.lineno - 1].strip(), ast.unparse(node)
    change(node)
    return Mutant(module, tree, function, node.lineno, text, before, ast.unparse(node))


def _places(tree: ast.Module) -> Iterator[tuple[str, ast.expr, Callable]]:
    """Expressions within functions that can be changed, and how."""
    for function, node in _computed(tree):
        if isinstance(node, ast.BinOp | ast.UnaryOp | ast.BoolOp) and type(node.op) in SWAPS:
            yield function, node, _swap
        if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
            yield function, node, _compare
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield function, node, _count


def _computed(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Bodies of functions and methods, by their names; without the words of an error."""
    for owner in (tree, *(part for part in tree.body if isinstance(part, ast.ClassDef))):
        name = f"{owner.name}." if isinstance(owner, ast.ClassDef) else ""
        for function in (part for part in owner.body if isinstance(part, ast.FunctionDef)):
            for statement in function.body:
                yield from ((name + function.name, node) for node in _evaluated(statement))


def _evaluated(node: ast.AST) -> Iterator[ast.AST]:
    if not isinstance(node, ast.Raise | ast.arguments):
        yield node
        for child in ast.iter_child_nodes(node):
            yield from _evaluated(child)


def _swap(node) -> None:
    node.op = SWAPS[type(node.op)]()


def _compare(node) -> None:
    node.ops[0] = SWAPS[type(node.ops[0])]()


def _count(node) -> None:
    node.value = node.value + 1 if isinstance(node.value, int) else 1.5 * node.value or 1.0


class Changed(MetaPathFinder, SourceFileLoader):
    """Imports a mutant in the place of its module."""

    def __init__(self, mutant: Mutant) -> None:
        name = mutant.module.removesuffix(".py").replace("/", ".")
        super().__init__(f"beadwave.{name}", str(PACKAGE / mutant.module))
        self.tree = mutant.tree

    def find_spec(self, fullname, path=None, target=None) -> ModuleSpec | None:
        """Of the mutant's module alone."""
        return spec_from_file_location(fullname, loader=self) if fullname == self.name else None

    def get_code(self, fullname):
        """The mutant, at the lines of the source."""
        return compile(self.tree, self.path, "exec")


class Reach:
    """Functions of some modules that each test calls, and its seconds."""

    def __init__(self, modules: tuple[str, ...]) -> None:
        self.modules = {str(PACKAGE / module): module for module in modules}
        self.called: defaultdict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item):
        """Calls of fixtures count for all tests of the file."""
        with self._noted(self.called[item.nodeid.split("::")[0]]):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        """Calls of the test itself."""
        began = time.process_time()
        with self._noted(self.called[item.nodeid]):
            result = yield
        self.seconds[item.nodeid] = time.process_time() - began
        return result

    @contextmanager
    def _noted(self, called: set[str]):
        def call(frame, _event, _argument):
            module = self.modules.get(frame.f_code.co_filename)
            if module:
                called.add(f"{module} {frame.f_code.co_qualname.split('.<locals>')[0]}")

        sys.settrace(call)
        try:
            yield
        finally:
            sys.settrace(None)

    def tests(self) -> list[tuple[str, float, list[str]]]:
        """Each with its seconds and the functions that it calls, the quickest first."""
        return [
            (test, seconds, sorted(self.called[test] | self.called[test.split("::")[0]]))
            for test, seconds in sorted(self.seconds.items(), key=lambda pair: pair[1])
        ]


def watched(room: Room, found: Path) -> None:
    """Write what `Reach` finds in a room without a mutant."""
    reach = Reach(room.modules)
    status = _pytest(["tests/{}/test_{}.py".format(*name.split("/")) for name in room.tests], reach)
    slow = [test for test, seconds in reach.seconds.items() if seconds > LONGEST]
    if slow and not status:  # the first time they may have compiled
        status = _pytest(slow, reach)
    found.write_text(json.dumps(reach.tests()))
    os._exit(status)


def tried(mutant: Mutant, tests: list[str], seconds: float) -> None:
    """End with status 0 where all tests pass with the mutant in its module's place."""
    setrlimit(RLIMIT_CPU, (int(seconds), int(seconds)))
    folder = TemporaryDirectory()
    # what numba keeps is told apart by the files, not the mutants
    if mutant.module in COMPILED:
        sys.modules["numba"].config.CACHE_DIR = folder.name
    elif "/kernels/" in mutant.module:
        sys.modules["numba"].config.DISABLE_JIT = True
    sys.meta_path.insert(0, Changed(mutant))
    status = _pytest(tests)
    folder.cleanup()
    os._exit(status)


def _pytest(tests: list[str], *plugins) -> int:
    os.chdir(ROOT)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", QUICK]
    return int(pytest.main([*options, *tests], plugins=plugins))


def status(work: Callable, *arguments) -> int:
    """Of work in a process of its own."""
    sys.stdout.flush()
    process = get_context("fork").Process(target=work, args=arguments)
    process.start()
    process.join()
    return process.exitcode


def survives(mutant: Mutant, reach: list) -> bool:
    """True if no test that calls the mutant's function fails."""
    function, compiled = f"{mutant.module} {mutant.function}", mutant.module in COMPILED
    tests = {test: s for test, s, called in reach if compiled or function in called}
    tests = {test: s for test, s in tests.items() if s < LONGEST}
    limit = 20 + 5 * sum(tests.values()) + 300 * compiled
    return not tests or not status(tried, mutant, [*tests], limit)


def drawn(modules: tuple[str, ...], count: int, chance: Random) -> list[Mutant]:
    """Mutants of modules, none twice."""
    every = [(module, i) for module in modules for i in range(size(module))]
    return [mutant_of(*one) for one in chance.sample(every, min(count, len(every)))]


def main(name: str, modules: tuple[str, ...], count: int, seed: int) -> None:
    """Draw, run and count in one room."""
    room = ROOMS[name]
    with TemporaryDirectory() as folder:
        found = Path(folder, "reach.json")
        if status(watched, room, found):
            sys.exit(f"the tests of {name} fail without a mutant; mend them first.")
        reach = json.loads(found.read_text())
    tally = Counter()
    for mutant in drawn(modules, count, Random(f"{seed} {name}")):
        fate = "noticed"
        if survives(mutant, reach):
            fate = "explained" if mutant.reason else "SURVIVED"
        tally[fate] += 1
        line = f"{fate} {mutant.module}:{mutant.line} {mutant.function}: {mutant.before}"
        print(f"{line}  ->  {mutant.after}  {mutant.reason or ''}", flush=True)
    told = tally["noticed"] + tally["SURVIVED"]
    share = f"{tally['noticed'] / max(told, 1):.0%}"
    print(f"{name}: {tally['noticed']} of {told} noticed, {share}; {tally['explained']} explained.")


if __name__ == "__main__":
    one_thread = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
    os.environ.update(dict.fromkeys(one_thread, "1"))
    for library in LOADED:  # once, before the processes of the mutants are forked off
        import_module(library)
    words = sys.argv[1:]
    numbers = [int(word) for word in words if word.isdigit()]
    asked = [word for word in words if not word.isdigit()]
    for name, room in ROOMS.items():
        modules = tuple(m for m in room.modules if m in asked or name in asked or not asked)
        if modules:
            main(name, modules, *(numbers + [20, 1][len(numbers) :]))
