"""The further solve with halved cells in contact, which tells the error of the largest pressure."""

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone

from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History
from signorini_fx.results.accuracy.peak_error import Peak
from signorini_fx.scenes.mesh_sequence import meshed_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving import to_accuracy
from signorini_fx.solving.finer_zone import peak_of_finer_zone
from signorini_fx.tuned import LARGEST_ZONE


def layer(size, degree=1, cell="quadrilateral"):
    """A layer bonded to a rigid base, under a parabola whose tip is at no node; cells of this length."""
    mesh = {"length": 8.0, "height": 1.0, "nx": round(8 / size), "ny": round(1 / size), "cell": cell}
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": mesh},
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
            "contact": {"boundary": "top", "gap": "(x[0] - 4.03)**2 / 80 - 0.016"},
        }
    )


def ball(size, degree=1, load=1.2):
    """A quarter of half a ball of radius 5 on a plane; cells of this length in contact."""
    mesh = {"part": "quarter", "radius": 5.0, "size": max(1.5, 2 * size), "contact_size": size, "contact_zone": 1.2}
    return parse_scene(
        {
            "mesh": {"generator": "half_sphere", "parameters": {**mesh, "order": degree}},
            "element": {"degree": degree},
            "material": {"young": 200.0, "poisson": 0.3},
            "displacement": [{"boundary": "symmetry_x", "x": 0.0}, {"boundary": "symmetry_y", "y": 0.0}],
            "traction": {"boundary": "top", "pressure": load},
            "contact": {"boundary": "sphere", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
        }
    )


def solved_mesh(scene):
    problem = meshed_scene(scene, MPI.COMM_SELF, History())
    return problem, problem.solved(0, None, None)


SCENES = {
    "quadrilaterals": (lambda: layer(0.25), lambda: layer(1 / 48, 2)),
    "quadrilaterals of degree 2": (lambda: layer(0.25, 2), lambda: layer(1 / 48, 2)),
    "tetrahedra": (lambda: ball(0.3, 2), lambda: ball(0.1, 2)),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("cells", SCENES)
def test_halved_cells_have_most_of_the_error_no_more(cells):
    """Nodes in contact are twice as dense, and the top of the pressure is nearer to that of a fine mesh."""
    coarse, fine = (make() for make in SCENES[cells])
    reference = Peak.of(alone(fine).table).top
    problem, solved = solved_mesh(coarse)
    events = len(problem.history.events)
    zone = peak_of_finer_zone(problem, solved)
    (told,) = problem.history.events[events:]
    assert told.startswith("largest pressure: its error is told by halved cells in contact")
    last = Peak.of(solved.level.table)
    assert zone.peak.spacing == pytest.approx(last.spacing / 2, rel=0.1)
    assert abs(zone.peak.top / reference - 1) < 0.6 * abs(last.top / reference - 1)
    assert zone.energy < solved.level.energy


def test_its_solves_count():
    """In the history of all meshes, and in the row of the mesh, whose numbers go on without a gap."""
    problem, solved = solved_mesh(layer(0.25))
    before = problem.history.linear_solves
    assert peak_of_finer_zone(problem, solved) is not None
    own = int(re.search(r"(\d+) linear solves", problem.history.events[-1])[1])
    assert problem.history.linear_solves - before == own > 0
    scene = layer(0.125).model_copy(update={"accuracy": Accuracy(target=0.02, of="peak")})
    solution = alone(scene)
    told = [event for event in solution.history.events if event.startswith("largest pressure:")]
    assert told
    history = solution.history
    assert sum(level.linear_solves for level in solution.levels) == history.linear_solves
    assert [record.solve for record in history.iterations] == [*range(1, history.linear_solves + 1)]
    assert solution.price_list[len(solution.levels) - 1].linear_solves == solution.levels[-1].linear_solves


def test_neither_solves_nor_cells_without_end():
    problem, solved = solved_mesh(layer(0.25))
    solves, grown = problem.history.linear_solves, []

    def allowed(growth):
        grown.append(growth)
        return False

    assert peak_of_finer_zone(problem, solved, allowed=allowed) is None
    assert 1 < grown[0] <= LARGEST_ZONE[2]
    assert problem.history.linear_solves == solves
    # Whoever has no linear solves left gets none.
    own = History([*problem.history.iterations], limit=solves)
    assert peak_of_finer_zone(replace(problem, history=own), solved) is None
    assert own.linear_solves == solves
    own.limit = solves + 1
    peak_of_finer_zone(replace(problem, history=own), solved)
    assert own.linear_solves == solves + 1


def test_beyond_the_budget_it_is_not_begun(monkeypatch):
    """The estimate without it stands."""
    scene = layer(0.125).model_copy(update={"accuracy": Accuracy(target=0.04, of="peak", seconds=60.0)})
    begun, exceeded = [], to_accuracy.Budget.exceeded

    def too_much(self, rows, finer, last):
        begun.append(finer)
        return to_accuracy.Exceeded(None, "everything")

    with_it = alone(scene)
    monkeypatch.setattr(to_accuracy.Budget, "exceeded", too_much)
    without = alone(scene)
    assert begun
    assert any(event.startswith("largest pressure:") for event in with_it.history.events)
    assert not any(event.startswith("largest pressure:") for event in without.history.events)
    assert without.price_list[2].peak != with_it.price_list[2].peak
    assert exceeded is not to_accuracy.Budget.exceeded


def test_all_cells_halved():
    """Of meshes that are divided here and there: four times the cells."""
    problem, solved = solved_mesh(layer(0.25, cell="triangle"))
    grown = []
    peak_of_finer_zone(problem, solved, everywhere=True, allowed=lambda growth: bool(grown.append(growth)))
    assert grown == [4.0]
    assert np.isfinite(Peak.of(solved.level.table).top)
