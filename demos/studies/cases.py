"""What the studies of accuracy look at: scenes, and what their solutions are measured against."""

import tomllib
from functools import cache
from pathlib import Path

from mpi4py import MPI
from reference import Reference, divided, reference_errors, reference_solution
from varied import varied

from signorini_fx.scenes.reading import parse_scene, read_scene

SCENES = Path(__file__).parent.parent / "scenes"
UNKNOWNS = 200_000
# The gap of the true circle at the nodes inside the facets too, which are not on it.
TRUE_SHAPE = "8 - sqrt(max(0, 64 - x[0]**2))"


def scene_of(name):
    """A scene of the demos; ``hertz_degree2`` is Hertz with quadratic elements."""
    if name != "hertz_degree2":
        return read_scene(SCENES / f"{name}.toml")
    data = tomllib.loads((SCENES / "hertz.toml").read_text(encoding="utf-8"))
    data["contact"][0]["gap"] = TRUE_SHAPE
    return parse_scene({**data, "element": {"degree": 2}}, name)


def reference_of(name):
    """A reference of much higher accuracy, and how far it may be wrong."""
    if not name.startswith("hertz"):
        return reference_solution(varied(scene_of(name), MPI.COMM_SELF), 0.2, UNKNOWNS)
    return _hertz_reference()


@cache
def _hertz_reference():
    # From small cells on: where facets are divided, the body remains the polygon that it is.
    problem = varied(scene_of("hertz_degree2"), MPI.COMM_SELF)
    solutions = divided(problem, 1 / 3, UNKNOWNS)
    reference, finest = Reference(solutions[-1]), solutions[-1].model.dofs
    coarse = (divided(problem, k / 3, finest / k**2)[-1] for k in (2, 4))
    return reference, reference_errors(*(reference.errors(solution) for solution in coarse))
