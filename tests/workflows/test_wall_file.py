"""Reduced models made elsewhere as the wall: Abaqus substructures, and files that are no walls."""

import json
import re
import tomllib
from base64 import b85decode
from contextlib import nullcontext
from functools import partial
from zipfile import ZipFile
from zlib import decompress

import numpy as np
import pytest
from joblib import Memory
from scipy.linalg import eigh

from beadwave import rom
from beadwave.rom.imported import Limits, sound
from beadwave.workflows.commands.app import main
from beadwave.workflows.files.scene import scene
from beadwave.workflows.files.wall_file import loaded
from beadwave.workflows.run.run import impact
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import resolved, toml
from beadwave.workflows.stages.chain.chain import flat
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.warnings import unusual_wall_file

RUN = ("wall.kind=rom", "time.duration=3e-4", "output.samples=301")
NODES = ("wall.nodes=[7, 8]", "wall.direction=1", "wall.weights=[3.0, 1.0]")


def chain_of_masses(n=6, stiffness=2e8, mass=0.4):
    K = stiffness * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    return K, mass * np.eye(n)


def aluminium_cantilever(n=6, length=0.3, width=0.03, thickness=3e-3, young=70e9, density=2700.0):
    """A strip of beam elements, struck at its free end: 1.9e-3 m/N there, first mode 27 Hz."""
    h, EI = length / n, young * width * thickness**3 / 12
    k = EI / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    )  # fmt: skip
    m = density * width * thickness * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
    )  # fmt: skip
    K, M = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for i in range(0, 2 * n, 2):
        K[i : i + 4, i : i + 4] += k
        M[i : i + 4, i : i + 4] += m
    return K[2:, 2:], M[2:, 2:], np.eye(2 * n)[2 * n - 2]


def floating():
    """The K of the same masses without their springs to the ground."""
    K = chain_of_masses()[0]
    K[0, 0] = K[-1, -1] = K[0, 0] / 2
    return K


def substructure_text(K, M, nodes):
    """Text as *SUBSTRUCTURE MATRIX OUTPUT writes it: three degrees of freedom of every node."""
    named = ",".join(f" {node}" for node in nodes)
    head = f"*USER ELEMENT, NODES= {len(nodes)}, LINEAR\n** ELEMENT NODES\n**{named}\n 1, 2, 3\n"
    lines = [head]
    for kind, A in (("STIFFNESS", K), ("MASS", M)):
        lines.append(f"*MATRIX,TYPE={kind}\n")
        lines += [", ".join(f"{x:.16E}" for x in row[: i + 1]) + "\n" for i, row in enumerate(A)]
    return "".join(lines)


def test_an_abaqus_substructure_is_the_wall_that_its_matrices_are(tmp_path):
    """K, M and w through .mtx and .npz make equal oscillators, half-space taken out."""
    K, M = chain_of_masses()
    (tmp_path / "sub.mtx").write_text(substructure_text(K, M, (7, 8)))
    w = np.array([0.75, 0, 0, 0.25, 0, 0])
    rom.save_npz(tmp_path / "sub.npz", rom.full_order(K, M, w))
    local = "wall.half_space=1e-10"
    walls = [
        wall_of(scene("rig-rigid", (*RUN, f"wall.file={tmp_path / name}", local, *more)))
        for name, more in (("sub.mtx", NODES), ("sub.npz", ()))
    ]
    np.testing.assert_allclose(walls[0].omega, walls[1].omega, rtol=1e-12)
    np.testing.assert_allclose(np.abs(walls[0].phi), np.abs(walls[1].phi), rtol=1e-9, atol=1e-12)
    assert walls[0].residual_compliance / -1e-10 == pytest.approx(1.0)


def test_a_patch_of_quadratic_elements_has_negative_weights_too(tmp_path):
    """Ours of a block written as a substructure: refused once, since a weight was below zero."""
    (tmp_path / "sub.mtx").write_text(substructure_text(*chain_of_masses(), (7, 8)))
    given = ("wall.nodes=[7, 8]", "wall.weights=[1.25, -0.25]")
    read = loaded(scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'sub.mtx'}", *given)).wall)
    np.testing.assert_allclose(read.w, [1.25, 0, 0, -0.25, 0, 0])


def test_an_abaqus_substructure_runs_with_the_chain(tmp_path, monkeypatch, capsys):
    (tmp_path / "sub.mtx").write_text(substructure_text(*chain_of_masses(), (7, 8)))
    changes = [f"--set={c}" for c in (*RUN, f"wall.file={tmp_path / 'sub.mtx'}", *NODES)]
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.argv", ["beadwave", "impact", "rig-rigid", "--json", *changes])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert '"n_wall_modes": 6' in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ((), "wall.nodes is missing.*7, 8"),
        (("wall.nodes=[7, 9]",), r"no coordinate \(node, dof\) = \(9, 1\)"),
        (("wall.nodes=[7, 8]", "wall.weights=[1.0]"), "wall.weights has 1 values for 2"),
        (("wall.nodes=[7]", "wall.direction=4"), "wall.direction = 4"),
        (("wall.nodes=[7, 8]", "wall.weights=[1.0, -1.0]"), "sum to zero and are no average"),
    ],
)
def test_a_substructure_without_a_contact_is_refused(tmp_path, changes, words):
    (tmp_path / "sub.mtx").write_text(substructure_text(*chain_of_masses(), (7, 8)))
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'sub.mtx'}", *changes))


@pytest.mark.parametrize(("matrix", "words"), [("K", "stiffness is indefinite"), ("M", "M is not")])
def test_an_indefinite_file_is_refused_before_a_folder_is_made(
    tmp_path, monkeypatch, capsys, matrix, words
):
    K, M = chain_of_masses()
    parts = {"K": K, "M": M, "w": np.eye(6)[0]}
    parts[matrix] = parts[matrix] - 1.5 * parts[matrix][2, 2] * np.diag(np.eye(6)[2])
    np.savez(tmp_path / "bad.npz", **parts)
    changes = [f"--set={c}" for c in (*RUN, f"wall.file={tmp_path / 'bad.npz'}")]
    out = tmp_path / "out"
    monkeypatch.setattr("sys.argv", ["beadwave", "run", "rig-rigid", "--out", str(out), *changes])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def refused(tmp_path, name, **parts):
    K, M = chain_of_masses()
    content = {"K": K, "M": M, "w": np.eye(6)[0]} | parts
    np.savez(tmp_path / name, **{key: value for key, value in content.items() if value is not None})
    return scene("rig-rigid", (*RUN, f"wall.file={tmp_path / name}"))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"w": None}, "holds no w"),
        ({"centre_m": np.ones(2)}, "centre_m is .* must hold three numbers"),
        ({"reading_weights": np.ones((2, 6))}, "12 values for 6 coordinates"),
        ({"w": np.eye(6)[0] * (1 + 1j)}, "w is complex"),
        ({"w": np.ones(4)}, r"w has shape \(4,\)"),
        ({"K": chain_of_masses()[0] * (1 + 0.01j)}, "K is not a real matrix"),
        ({"M": np.eye(5)}, "M is 5 x 5, K is 6 x 6"),
        ({"n_residual": 50}, "n_residual is 50; it must be from 0 to 6"),
        ({"n_boundary": -1}, "n_boundary is -1"),
        ({"provenance": "[1, 2]"}, "must be a JSON object"),
        ({"provenance": '{"half_space_compliance_m_per_N": "abc"}'}, "one number >= 0"),
        (
            {"provenance": '{"half_space_compliance_m_per_N": -1e-9}'},
            "a compliance is one number >= 0",
        ),
        ({"provenance": '{"hammer_modes_hz": "a b"}'}, "must hold numbers"),
        ({"provenance": '{"mass_kg": "heavy"}'}, "must hold one number"),
        ({"K": floating() - 1e-7 * 2e8 * np.eye(6)}, "written with few digits"),
        ({"provenance": '{"reading_weights": "1 2 3 4 5 6 7"}'}, "7 values for 6 coordinates"),
    ],
)
def test_a_file_that_is_no_reduced_model_is_refused_in_a_sentence(tmp_path, parts, words):
    with pytest.raises(InvalidScene, match=words):
        refused(tmp_path, "bad.npz", **parts)


def test_a_file_of_matlab_7_3_is_refused_with_the_way_out(tmp_path):
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    (tmp_path / "new.mat").write_bytes(head + bytes(500))
    with pytest.raises(InvalidScene, match="save it with '-v7'"):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'new.mat'}"))


KILLS_SCIPY = (
    "c-r%I4DoSvQZUssQ1EpO(M`+DNmU5QNi0drFUqx2D9A6)tk6+#E=o--Nlj76&$ChpPApOI%P&(fG6W(kQxhvwAj81OjDZZ"
    "m=;_M`q$+@z4Tw2_m=%bbp)?1S4Z@5-=nWO;foTU~CMX*uE`TNu(#HwJ5^xJY*rU^=*zb$S{xuZX?}21L8<KxGpk~4BFDK"
    "GG10?fUu$adJHLn=#W)_B$)QS?2z6D777_sPMg6c~K(jfH~Nb32psAohnhX*b$1m<ILX9qt00zg(GkOlzV0xFm"
)


def test_a_file_that_crashes_its_reader_is_refused_in_a_sentence(tmp_path):
    """Three bytes of a good .mat changed: reading it ended the whole program, mostly by SIGSEGV.

    What it meets beyond its buffers is chance, so it may also end in an exception.
    """
    (tmp_path / "crash.mat").write_bytes(decompress(b85decode(KILLS_SCIPY)))
    with pytest.raises(
        InvalidScene, match=r"crash\.mat(: its reader crashes \(SIG| cannot be read)"
    ):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'crash.mat'}"))


@pytest.mark.parametrize("shape", ["(1000000, 1000000)", "(4, 4)"])
def test_an_archive_that_says_more_than_it_holds_is_refused(tmp_path, shape):
    refused(tmp_path, "good.npz")
    with ZipFile(tmp_path / "good.npz") as good, ZipFile(tmp_path / "bad.npz", "w") as bad:
        for entry in good.infolist():
            raw = good.read(entry)
            if entry.filename == "K.npy":
                raw = raw.replace(b"(6, 6), }" + b" " * (len(shape) - 6), f"{shape}, }}".encode())
            bad.writestr(entry, raw)
    with pytest.raises(InvalidScene, match=re.escape(f"K.npy does not hold the {shape}")):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'bad.npz'}"))


@pytest.mark.parametrize("ground", [0.0, -2e8, -5e8], ids=["held", "floating", "indefinite"])
def test_a_run_solves_for_the_modes_of_a_file_once(tmp_path, monkeypatch, ground):
    """Of 2500 coordinates each solution takes seconds; it was asked for five times."""
    solved = []

    def counted(*matrices, **options):
        solved.append(len(matrices[0]))
        return eigh(*matrices, **options)

    monkeypatch.setattr("beadwave.rom.reduced_model.eigh", counted)
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    K, M = chain_of_masses()
    ends = np.diag(np.r_[1.0, np.zeros(4), 1.0])
    np.savez(tmp_path / "wall.npz", K=K + ground * ends, M=M, w=np.eye(6)[0])
    with pytest.raises(InvalidScene, match="indefinite") if ground < -2e8 else nullcontext():
        chosen = scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'wall.npz'}"))
        impact(pipeline_of(chosen, lambda name: nullcontext()), None)
    assert solved == [6]


def test_a_wall_of_too_many_coordinates_is_refused(tmp_path, monkeypatch):
    small = partial(sound, limits=Limits(n_coordinates=5))
    monkeypatch.setattr("beadwave.workflows.files.wall_file.sound", small)
    with pytest.raises(InvalidScene, match="has 6 coordinates, allowed are 5; reduce it further"):
        refused(tmp_path, "large.npz")


@pytest.mark.slow
def test_a_wall_comes_the_same_through_every_format(tmp_path):
    model = rom.full_order(*chain_of_masses(), np.eye(6)[0])
    for ending, save in (("npz", rom.save_npz), ("mat", rom.save_mat)):
        save(tmp_path / f"wall.{ending}", model)
    read = [
        loaded(scene("rig-rigid", (*RUN, f"wall.file={tmp_path / f'wall.{ending}'}")).wall)
        for ending in ("npz", "mat")
    ]
    for ours, theirs in zip(*read, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_node_named_twice_is_refused(tmp_path):
    """Its weight was once halved in silence."""
    (tmp_path / "sub.mtx").write_text(substructure_text(*chain_of_masses(), (7, 8)))
    with pytest.raises(InvalidScene, match="names node 7 twice"):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'sub.mtx'}", "wall.nodes=[7, 7]"))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({}, None),
        ({"w": 2 * np.eye(6)[0]}, "sum to 2, not to 1"),
        ({"w": -np.eye(6)[0]}, None),  # read and pushed from the other side
        ({"K": 1e-6 * chain_of_masses()[0]}, "highest mode of wall.file is 6.94 Hz"),  # kN/mm
        ({"K": 1e-9 * chain_of_masses()[0]}, "static compliance at the contact of wall.file"),
        (dict(zip("KMw", aluminium_cantilever(), strict=True)), None),
        ({"M": 1e-6 * chain_of_masses()[1]}, "lowest elastic mode of wall.file is .*e.06 Hz"),
        ({"K": np.diag([1e7, 2e8]), "M": np.eye(2), "w": np.ones(2)}, None),  # modal coordinates
        ({"K": np.zeros((6, 6))}, "its 6 coordinates are loose masses"),
        ({"K": np.zeros((1, 1)), "M": np.eye(1), "w": np.ones(1)}, None),  # a mass that flies
        ({"K": floating(), "w": np.eye(6)[0]}, None),
        (
            {"K": np.diag(np.r_[2e8, np.zeros(7)]), "M": np.eye(8), "w": np.eye(8)[0]},
            "7 of the 8 modes of wall.file have no stiffness",
        ),
        ({"K": floating() + 1e-6 * chain_of_masses()[0]}, "1 modes up to .* Hz, the next is at"),
        (
            {"provenance": '{"half_space_compliance_m_per_N": 5e-9}'},
            "half-space taken off is 5e-09",
        ),
        ({"provenance": '{"half_space_compliance_m_per_N": 1e-10}'}, None),
    ],
)
def test_what_a_file_probably_meant_otherwise_is_told(tmp_path, parts, words):
    steel = {"young": 210e9, "poisson": 0.3}
    wall = refused(tmp_path, "odd.npz", **parts).wall.model_copy(update=steel)
    told = " ".join(unusual_wall_file(wall))
    assert (re.search(words, told) is not None) if words else not told


NOTES = '{"surface_young_Pa": "7e10", "surface_poisson": "0.34"}'


def test_the_material_of_a_file_is_that_of_the_contact(tmp_path):
    found = refused(tmp_path, "aluminium.npz", provenance=NOTES)
    assert flat(found) == (7e10, 0.34)
    assert (found.wall.young, found.wall.poisson) == (7e10, 0.34)  # as the resolved scene says
    assert resolved(tomllib.loads(toml(found)), "again") == found
    assert not list(unusual_wall_file(found.wall))


@pytest.mark.parametrize("change", ["wall.young=210e9", "wall.poisson=0.3"])
def test_a_material_other_than_the_file_s_is_refused(tmp_path, change):
    refused(tmp_path, "aluminium.npz", provenance=NOTES)
    key, value = change.split("=")
    with pytest.raises(
        InvalidScene, match=rf"{key} = {float(value):g}, but wall.file".replace("+", r"\+")
    ):
        scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'aluminium.npz'}", change))


def test_a_material_that_nobody_gave_is_told(tmp_path):
    found = refused(tmp_path, "silent.npz")
    assert "wall.young and wall.poisson" in next(unusual_wall_file(found.wall))
    given = scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'silent.npz'}", "wall.young=70 GPa"))
    assert flat(given) == (70e9, 0.3) and "says wall.poisson of" in next(
        unusual_wall_file(given.wall)
    )


@pytest.mark.parametrize(("name", "value"), [("young_Pa", -1), ("poisson", 0.7), ("young_Pa", "x")])
def test_a_material_that_no_solid_has_is_refused(tmp_path, name, value):
    with pytest.raises(InvalidScene, match=f"surface_{name} is '{value}'"):
        refused(tmp_path, "odd.npz", provenance=json.dumps({f"surface_{name}": str(value)}))


def test_a_reduced_model_carries_the_material_of_its_block(tmp_path):
    coarse = ("mesh.seed=0.02", "mesh.block_seed=0.05", "mesh.support_seed=0.1",
              "mesh.contact_seed=0.03",
              "reduction.modes=8", 'assembly.parts=["block","sheets"]',
              "assembly.block.young=70 GPa", "assembly.block.poisson=0.34")  # fmt: skip
    reduced = Pipeline(scene("rig-rom", coarse), Memory(None, verbose=0))("reduction")
    rom.save_npz(tmp_path / "rom.npz", reduced)
    found = scene("rig-rigid", (*RUN, f"wall.file={tmp_path / 'rom.npz'}"))
    assert flat(found) == (70e9, 0.34)
