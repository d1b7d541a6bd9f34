"""Reduced models made elsewhere as the wall: Abaqus substructures, and files that are no walls."""

import re

import numpy as np
import pytest

import rom
from workflows.chain_stages import wall as wall_of
from workflows.cli import main
from workflows.scene import InvalidScene
from workflows.scene_file import scene
from workflows.wall_doubts import doubts
from workflows.wall_file import loaded

RUN = ("wall.kind=rom", "time.duration=3e-4", "output.samples=301")
NODES = ("wall.nodes=[7, 8]", "wall.direction=1", "wall.weights=[3.0, 1.0]")


def chain_of_masses(n=6, stiffness=2e8, mass=0.4):
    K = stiffness * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    return K, mass * np.eye(n)


def floating():
    """The K of the same masses without their springs to the ground."""
    K = chain_of_masses()[0]
    K[0, 0] = K[-1, -1] = K[0, 0] / 2
    return K


def substructure_text(K, M, nodes):
    """What *SUBSTRUCTURE MATRIX OUTPUT writes: three degrees of freedom of every node."""
    named = ",".join(f" {node}" for node in nodes)
    head = f"*USER ELEMENT, NODES= {len(nodes)}, LINEAR\n** ELEMENT NODES\n**{named}\n 1, 2, 3\n"
    lines = [head]
    for kind, A in (("STIFFNESS", K), ("MASS", M)):
        lines.append(f"*MATRIX,TYPE={kind}\n")
        lines += [", ".join(f"{x:.16E}" for x in row[: i + 1]) + "\n" for i, row in enumerate(A)]
    return "".join(lines)


def test_an_abaqus_substructure_is_the_wall_that_its_matrices_are(tmp_path):
    """The same K, M and w through .mtx and .npz: the same oscillators, half-space taken out."""
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
    assert walls[0].residual_compliance == pytest.approx(-1e-10)


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
        ({"w": np.eye(6)[0] * (1 + 1j)}, "w is complex"),
        ({"w": np.ones(4)}, r"w has shape \(4,\)"),
        ({"K": chain_of_masses()[0] * (1 + 0.01j)}, "K is not a real matrix"),
        ({"M": np.eye(5)}, "M is 5 x 5, K is 6 x 6"),
        ({"n_residual": 50}, "n_residual is 50; it must be from 0 to 6"),
        ({"n_boundary": -1}, "n_boundary is -1"),
        ({"provenance": "[1, 2]"}, "must be a JSON object"),
        ({"provenance": '{"half_space_compliance_m_per_N": "abc"}'}, "must hold numbers"),
        ({"provenance": '{"half_space_compliance_m_per_N": -1e-9}'}, "a compliance is >= 0"),
        ({"provenance": '{"hammer_modes_hz": "a b"}'}, "must hold numbers"),
        ({"provenance": '{"mass_kg": "heavy"}'}, "must hold numbers"),
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
        ({"K": 1e-6 * chain_of_masses()[0]}, "static compliance at the contact of wall.file"),
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
    told = " ".join(doubts(refused(tmp_path, "odd.npz", **parts).wall))
    assert (re.search(words, told) is not None) if words else not told
