"""Kills what a sweep on a cluster stands on, and fills its disk: the table stays what it is.

    python tests/tools/hostile/sweeps.py [COUNT]

The client, the scheduler and the worker get a SIGKILL in turn, each at a moment drawn anew; what is
gone is started again and the same command given until it ends. Then a sweep writes to a disk of
64 kB (where this process may mount one), and to a larger one. Each table must be that of a sweep
which nobody disturbed. Exits with 1 and a sentence at the first that is not.
"""

import os
import socket
import subprocess
import sys
from pathlib import Path
from random import Random
from shutil import copytree
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import numpy as np

from beadwave import load_sweep

SWEEP = (
    sys.executable, "-P", "-m", "beadwave", "sweep", "rig-rigid", "--over", "chain.count=5:34:30",
    "--over", "striker.velocity=0.1,0.2", "--set", "output.spheres=[1,4]", "--set",
    "contact.coefficient=1.0", "--signals", "--set", "output.samples=301",
)  # fmt: skip
PATIENCE = 300  # s
AGAIN = ("status", "message", "seconds")  # columns that no answer is in


class Cluster:
    """A scheduler and a worker, each a process."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.parts: dict[str, subprocess.Popen] = {}
        self.complete()

    def complete(self) -> None:
        """Start what does not run."""
        commands = {
            "scheduler": ("dask_scheduler", "--host", "127.0.0.1", "--port", f"{self.port}"),
            "worker": ("dask_worker", self.address, "--nthreads", "1", "--no-nanny"),
        }
        for name, (module, *options) in commands.items():
            if name not in self.parts or self.parts[name].poll() is not None:
                words = (sys.executable, "-m", f"distributed.cli.{module}", *options)
                self.parts[name] = subprocess.Popen(
                    [*words, "--no-dashboard"], stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL, start_new_session=True,
                )  # fmt: skip
        for _ in range(PATIENCE):
            with socket.socket() as trial:
                if trial.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            sleep(0.1)
        require(False, "no scheduler starts")

    def kill(self, name: str) -> None:
        self.parts[name].kill()
        self.parts[name].wait()


def main(count: int) -> None:
    """Disturb `count` sweeps, then fill a disk."""
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        cluster = Cluster()
        try:
            swept("undisturbed", cluster.address)
            began = perf_counter()
            swept("timed", cluster.address)
            lasts, moments = perf_counter() - began, Random(7)
            for i in range(count):
                who = ("client", "scheduler", "worker")[i % 3]
                disturbed(cluster, who, lasts * (0.3 + 0.7 * moments.random()), f"out-{i}")
        finally:
            for name in cluster.parts:
                cluster.kill(name)
        print(f"{count} kills within {lasts:.1f} s: the table stays what it is.")
        full_disk(Path("disk"))


def started(out: str, *options: str) -> subprocess.Popen:
    words = [*SWEEP, "--out", out, *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(words, **pipes, start_new_session=True)


def swept(out: str, address: str) -> None:
    process = started(out, "--scheduler", address)
    said = process.communicate(timeout=PATIENCE)[1]
    require(process.returncode == 0, f"status {process.returncode}: {said}")


def disturbed(cluster: Cluster, who: str, moment: float, out: str) -> None:
    """A sweep that loses somebody, and the same command until it ends."""
    process = started(out, "--scheduler", cluster.address)
    sleep(moment)
    if who == "client":
        process.kill()
    else:
        cluster.kill(who)
        if who == "worker":
            cluster.complete()
    said, where = process.communicate(timeout=PATIENCE)[1], f"{who} killed after {moment:.2f} s"
    require(who != "worker" or process.returncode == 0, f"{where}: {process.returncode} {said}")
    require("Traceback" not in said, f"{where}: {said}")
    if who == "scheduler":
        cluster.kill("worker")  # which ends at a moment of its own
    cluster.complete()
    swept(out, cluster.address)
    require_same(out, where)


def full_disk(disk: Path) -> None:
    """A sweep on a disk that fills, and the same on one with room."""
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        print("no disk is filled: this process may mount none.")
        return
    try:
        process = started(str(disk / "out"))
        said = process.communicate(timeout=PATIENCE)[1]
        require(process.returncode == 1, f"full disk: status {process.returncode}")
        require("make room" in said, f"full disk: said {said}")
        copytree(disk / "out", "roomy")
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    process = started("roomy")
    said = process.communicate(timeout=PATIENCE)[1]
    require(process.returncode == 0, f"after the full disk: status {process.returncode} {said}")
    require_same("roomy", "full disk")
    print("a full disk: the table stays what it is.")


def require_same(out: str, where: str) -> None:
    right, found = load_sweep("undisturbed"), load_sweep(out)
    for name, values in right.columns.items():
        if name in AGAIN[1:]:
            continue
        same = np.array_equal(values, found.columns[name]) if name in AGAIN else np.allclose(
            values.astype(float), found.columns[name].astype(float), 1e-12, 1e-15, equal_nan=True
        )  # fmt: skip
        require(same, f"{where}: another {name}")
    v = [sweep.signals()["v"].to_numpy() for sweep in (right, found)]
    require(np.allclose(*v, 1e-6, 1e-9), f"{where}: other signals")


def require(holds: bool, sentence: str) -> None:
    if not holds:
        sys.exit(f"sweeps.py: {sentence}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 6)
