"""Cells of degree 1 that are too stiff where a nonlinear body bends: the estimate against cells of degree 2."""

import re

import pytest
from mpi4py import MPI
from support.nonlinear_scenes import force, material

from signorini_fx import solve
from signorini_fx.scenes.reading import parse_scene

METAL = material("j2", yield_stress=10.0)


def rolled(cells, *, degree=1, cell="quadrilateral", depth=0.1, law=None):
    """A plank that is clamped at its end, and bent by a roller."""
    size = {"length": 20.0, "height": 0.6, "nx": cells[0], "ny": cells[1], "cell": cell}
    roller = {"shape": "circle", "centre": [18.0, 1.6], "radius": 1.0, "shift": [0.0, f"-{depth} * t"]}
    scene = {
        "mesh": {"generator": "rectangle", "parameters": size},
        "material": law or material("neo-hooke"),
        "element": {"degree": degree},
        "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
        "contact": {"boundary": "top", "foundation": roller},
        "solver": {"algorithm": "alm"},
        "load_steps": {"times": [1.0]},
    }
    return solve(parse_scene(scene), MPI.COMM_WORLD)


def share_of(solution):
    """By how much cells are too stiff, as a finding says it; None: none does."""
    shares = [re.search(r"too stiff by about (\d+) %", found.message) for found in solution.findings]
    return next((int(share[1]) / 100 for share in shares if share), None)


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize(
    ("cells", "changes"),
    [
        ((39, 2), {}),
        ((39, 2), {"depth": 4.0}),
        ((39, 2), {"law": METAL}),
        ((20, 4), {}),
        ((80, 6), {"cell": "triangle"}),
    ],
)
def test_a_plank_that_is_too_stiff(cells, changes):
    """Forces are too large by about as much as the warning says; with cells of degree 2 there is none."""
    solution, exact = rolled(cells, **changes), rolled((39, 2), degree=2, **changes | {"cell": "quadrilateral"})
    comm = MPI.COMM_WORLD
    pressed, wanted = (comm.allreduce(force(s.steps[-1])[1]) for s in (solution, exact))
    assert share_of(solution) == pytest.approx(pressed / wanted - 1, rel=0.55, abs=0.0)
    assert share_of(exact) is None
