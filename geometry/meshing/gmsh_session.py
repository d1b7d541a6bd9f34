"""gmsh's session: its global state opened, silenced and closed, its bare exceptions turned into
ValueError."""

import ctypes
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from signal import SIGINT, SIGTERM

import gmsh

from beadwave import system

# edges around a circle, at least: chords change its area by 2 pi^2 / (3 n^2), 1.6 %, which
# `geometry.meshing.roundness` restores
EDGES_AROUND = 20
# the same of curved elements, whose parabolas change the area by pi^4 / (30 n^4) or so, 3e-4
CURVED_EDGES_AROUND = 10

set_handler, handler_of = ctypes.pythonapi.PyOS_setsig, ctypes.pythonapi.PyOS_getsig
set_handler.argtypes, set_handler.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
handler_of.argtypes, handler_of.restype = (ctypes.c_int,), ctypes.c_void_p


@contextmanager
def session(failure: str = "gmsh could not mesh the assembly") -> Iterator[None]:
    """An empty model; raises ValueError "failure: what gmsh says" for any error of gmsh.

    Files hold lengths in their own unit, the model always in metres. gmsh has one state for the
    whole process: sessions do not nest, and what they drew is gone when they end.
    """
    # gmsh sets signals to their defaults behind Python's back: a run that is terminated later would
    # stop in the middle of a file, and one under nohup would end with its terminal
    numbers = system.existing(system.HANGUP, SIGINT, system.QUIT, SIGTERM)
    handlers = {number: handler_of(number) for number in numbers}
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    for number, handler in handlers.items():
        set_handler(number, handler)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", EDGES_AROUND)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        with failing(failure):
            yield
    finally:
        gmsh.finalize()


@contextmanager
def failing(failure: str) -> Iterator[None]:
    """Turns gmsh's errors into ValueError "failure: what gmsh says"."""
    try:
        yield
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exceptions
            raise
        raise ValueError(f"{failure}: {error}") from error


@contextmanager
def silent() -> Iterator[None]:
    """Discards what is printed to the process's standard output: OpenCASCADE reports its transfers
    there, whatever the options of gmsh are."""
    output = os.dup(1)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(output, 1)
        os.close(output)


@contextmanager
def boolean_tolerance(length: float) -> Iterator[None]:
    """Sets the distance [m] below which an intersection takes surfaces for one."""
    with _options({"Geometry.ToleranceBoolean": length}):
        yield


@contextmanager
def mesh_options(values: Mapping[str, float]) -> Iterator[None]:
    """Sets options of gmsh's group "Mesh", and what they were before at the end."""
    with _options({f"Mesh.{name}": value for name, value in values.items()}):
        yield


@contextmanager
def _options(values: Mapping[str, float]) -> Iterator[None]:
    """Sets options of gmsh, and what they were before at the end."""
    previous = {name: gmsh.option.getNumber(name) for name in values}
    for name, value in values.items():
        gmsh.option.setNumber(name, value)
    try:
        yield
    finally:
        for name, value in previous.items():
            gmsh.option.setNumber(name, value)
