"""The cache of results: what is damaged is computed again, what others can write is not read."""

import json
import os
import sys
from pathlib import Path

import pytest

from beadwave.workflows.commands.app import main
from beadwave.workflows.stages.engine import cache

SMALL = ("chain.count=3", "output.spheres=[1]", "output.samples=51", "time.duration=0.2e-3")

pytestmark = pytest.mark.usefixtures("own_folder")


def impact(capsys):
    """The summary of a small run, which stages were kept, and what was said of it."""
    changes = [f"--set={change}" for change in SMALL]
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr("joblib.memory._FUNCTION_HASHES", {})  # as in a process of its own
        patch.setattr(sys, "argv", ["beadwave", "impact", "rig-1dof", "--json", *changes])
        main()
    assert not end.value.code
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    said = "".join([printed.err, *(w for w in summary["warnings"] if "kept" in w)])
    return summary, [stage["cached"] for stage in summary["stages"]], said


def _flipped(content):
    return content[:-9] + bytes([content[-9] ^ 64]) + content[-8:]


DAMAGE = {
    "a bit": _flipped,
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda content: b"",
    "rubbish": lambda content: b"\x80\x05no pickle" * 9,
}


@pytest.mark.parametrize("name", ["output.pkl", cache.SUM, "metadata.json", "func_code.py"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_no_damage_to_the_cache_reaches_a_result(name, damage, tmp_path, capsys):
    summary, *_ = impact(capsys)
    files = list((tmp_path / "cache").rglob(name))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    again, kept, said = impact(capsys)
    assert again["waves"] == summary["waves"] and said == ""
    assert not any(kept) or name not in ("output.pkl", cache.SUM)
    healed, kept, said = impact(capsys)
    assert all(kept) and said == "" and healed["waves"] == summary["waves"]


def test_nobody_else_reads_the_cache(tmp_path, capsys):
    impact(capsys)
    for folder in (tmp_path / "cache", *(tmp_path / "cache").iterdir()):
        assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("below", ["", f"joblib-{cache.joblib_version}"])
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
def test_a_cache_that_others_may_write_into_is_not_read(below, mode, tmp_path, capsys):
    impact(capsys)
    (tmp_path / "cache" / below).chmod(mode)
    _, kept, said = impact(capsys)
    assert not any(kept)
    assert "is not trusted: others may write into" in said and "chmod go-w" in said


def test_a_cache_of_another_user_is_not_read(monkeypatch, capsys):
    impact(capsys)
    user = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    _, kept, said = impact(capsys)
    assert not any(kept) and "belongs to another user" in said


def test_a_cache_made_by_an_earlier_version_is_closed_to_others(tmp_path, capsys):
    (tmp_path / "cache" / f"joblib-{cache.joblib_version}").mkdir(parents=True)
    impact(capsys)
    _, kept, said = impact(capsys)
    assert all(kept) and said == ""
    assert Path(cache._results()).stat().st_mode & 0o777 == 0o700
