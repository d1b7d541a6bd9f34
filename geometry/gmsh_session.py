"""gmsh holds one global state: opened, silenced and closed here, its bare exceptions as ours."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import gmsh

EDGES_AROUND = 20  # edges around a circle, at least


@contextmanager
def session(failure: str = "gmsh could not mesh the assembly") -> Iterator[None]:
    """An empty model; raises ValueError "failure: what gmsh says" for any error of gmsh.

    Files hold lengths in their own unit, the model always in metres.
    """
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", EDGES_AROUND)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        yield
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exceptions
            raise
        raise ValueError(f"{failure}: {error}") from error
    finally:
        gmsh.finalize()


@contextmanager
def silent() -> Iterator[None]:
    """OpenCASCADE prints its transfers to the process's own output, past every option of gmsh."""
    kept = os.dup(1)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@contextmanager
def boolean_tolerance(length: float) -> Iterator[None]:
    """Within it, surfaces closer than `length` [m] are one surface to an intersection."""
    gmsh.option.setNumber("Geometry.ToleranceBoolean", length)
    try:
        yield
    finally:
        gmsh.option.setNumber("Geometry.ToleranceBoolean", 0.0)
