"""The command that changes scenes and files at random: a hundred of them, and its own faults."""

import time

import pytest

from beadwave.workflows.scene import InvalidScene

from hostile import fuzz


def reader_that(does):
    return fuzz.Kind(".txt", (b"",), lambda path: does())


def raises(error):
    raise error


@pytest.mark.parametrize("name", ["scene", "velocities", "hammer", "signals", "wall-mtx"])
def test_every_changed_text_is_read_or_refused_in_one_sentence(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert fuzz.main(40, 7, (name,)) == 0, capsys.readouterr().out


def test_a_step_file_that_crashes_its_reader_is_refused(tmp_path, monkeypatch, capsys):
    """The third one of this seed ends OpenCASCADE by a signal."""
    monkeypatch.chdir(tmp_path)
    assert fuzz.main(3, 1, ("step",)) == 0, capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(fuzz.kinds()))
def test_the_files_that_are_changed_are_good_themselves(name, tmp_path):
    kind = fuzz.kinds()[name]
    for i, good in enumerate(kind.samples):
        path = tmp_path / f"{i}{kind.ending}"
        path.write_bytes(good)
        kind.read(path)


@pytest.mark.parametrize(
    ("does", "word"),
    [
        (lambda: raises(ZeroDivisionError("by zero")), "ZeroDivisionError"),
        (lambda: raises(InvalidScene("two\nlines")), "no sentence"),
    ],
)
def test_other_ends_are_faults(does, word, tmp_path):
    assert word in fuzz.fault(reader_that(does), tmp_path / "x.txt")
    assert fuzz.fault(reader_that(lambda: None), tmp_path / "x.txt") is None


def test_a_reader_that_waits_for_ever_is_at_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "STUCK", 0.2)
    assert "took more than 0.2 s" in fuzz.fault(reader_that(lambda: time.sleep(60)), tmp_path)
