"""The problem files: complete, consistent, and readable by others; what is wrong in one is named by
its key.
"""

import re

import meshio
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ..elasticity import nodal_loads, nodal_weights, prescribed, values_at
from ..grids import make_grid
from ..mesh_files import inp_lines, write_msh
from ..problem import (
    FOLDER,
    ON_BOUNDARY,
    ProblemError,
    problem_names,
    read_problem,
)

NAMES = problem_names()
each_problem = pytest.mark.parametrize("name", NAMES)


@each_problem
def test_complete(name):
    """Every statement has its words, every reference its source, every boundary its facets and
    points their nodes.
    """
    problem = read_problem(name)
    for text in (problem.title, problem.text, problem.signs, problem.units, problem.source):
        assert len(text) > 5
    assert "pressure > 0" in problem.signs
    named = set()
    for level in (0, 1):
        grid = make_grid(problem, level)
        named = {c.boundary for c in problem.contacts} | {c.against for c in problem.contacts} - {
            ""
        }
        named |= {t.boundary for t in problem.tractions} | {
            s.boundary for s in problem.supports
        } - {""}
        assert named <= set(grid.facets)
        for boundary in named - {"axis"}:
            assert nodal_weights(problem, grid, boundary).sum() > 0
        assert np.isfinite(nodal_loads(problem, grid)).all()
        assert all(np.isfinite(value) for value in prescribed(problem, grid).values())
        for quantity in problem.quantities:
            if quantity.point:
                grid.node_at(np.array([problem.number(c) for c in quantity.point]))
            assert (
                quantity.boundary in {c.boundary for c in problem.contacts}
                or quantity.measure not in ON_BOUNDARY
            )
            assert all(len(source) > 5 for source in quantity.sources)
            assert len(quantity.text) > 5
            assert 0 < quantity.tolerance < 0.2
            assert quantity.scale > 0
        for contact in problem.contacts:
            gap = values_at(problem, contact.gap, grid.points[grid.nodes(contact.boundary)])
            assert np.isfinite(gap).all()
            direction = [problem.number(c) for c in contact.direction]
            assert not direction or np.linalg.norm(direction) == pytest.approx(1.0)


@each_problem
def test_meshes(name):
    """Cells are positive, a level divides each by two along each direction, named facets are on the
    outside.
    """
    problem = read_problem(name)
    coarse, fine = make_grid(problem), make_grid(problem, 1)
    d = problem.dimension
    assert len(fine.cells) == 2**d * len(coarse.cells)
    for grid in (coarse, fine):
        corners = grid.points[grid.cells]
        along = [corners[:, k] - corners[:, 0] for k in ((1, -1) if d == 2 else (1, 3, 4))]
        assert (np.linalg.det(np.stack(along, axis=1)) > 0).all()
        sides = [frozenset(row) for facets in grid.facets.values() for row in facets.tolist()]
        assert len(set(sides)) == len(sides)
        cells = [set(cell) for cell in grid.cells.tolist()]
        for side in sides[:: max(1, len(sides) // 7)]:
            assert sum(side <= cell for cell in cells) == 1
        # Every node belongs to one body.
        owners = [set(grid.cells[grid.body == k].ravel()) for k in range(len(grid.names))]
        assert sum(map(len, owners)) == len(grid.points) == len(set().union(*owners))


@pytest.mark.parametrize("name", ["smooth-edge", "lug-and-pin", "sphere-space"])
def test_files(tmp_path, name):
    """Other programs read the same mesh from both files: nodes, cells, names."""
    problem = read_problem(name)
    grid = make_grid(problem)
    write_msh(grid, tmp_path / "a.msh")
    text = "\n".join(inp_lines(grid, problem.hypothesis)) + "\n"
    # meshio knows plane stress alone among the plane elements.
    (tmp_path / "a.inp").write_text(re.sub("CPE4|CAX4", "CPS4", text))
    found = meshio.read(tmp_path / "a.msh")
    assert_allclose(found.points[:, : problem.dimension], grid.points, rtol=0, atol=1e-15)
    kind = {4: "quad", 8: "hexahedron"}[grid.cells.shape[1]]
    assert_array_equal(np.vstack([b.data for b in found.cells if b.type == kind]), grid.cells)
    assert set(found.field_data) == {*grid.facets, *grid.names}
    tag = {key: int(value[0]) for key, value in found.field_data.items()}
    across = {2: "line", 3: "quad"}[problem.dimension]
    rows = np.vstack([b.data for b in found.cells if b.type == across])
    tags = found.get_cell_data("gmsh:physical", across)
    for boundary, facets in grid.facets.items():
        assert_array_equal(rows[tags == tag[boundary]], facets)
    deck = meshio.read(tmp_path / "a.inp")
    assert_allclose(
        np.asarray(deck.points)[:, : problem.dimension], grid.points, rtol=1e-11, atol=1e-12
    )
    assert all(f"NAME=S_{boundary.upper()}," in text for boundary in grid.facets)
    assert all(
        len(word.strip()) <= 20 for line in text.splitlines()[1:5] for word in line.split(",")
    )


@pytest.mark.parametrize(
    ("pattern", "other", "message"),
    [
        (r"(?m)^title = .*$", "", "title is missing"),
        ('law = "none"', 'law = "glue"', "glue is missing, or not known"),
        ("law = ", "law == ", "line "),
    ],
)
def test_a_spoiled_file_is_refused(tmp_path, pattern, other, message):
    """With the file, and what is wrong."""
    text, count = re.subn(
        pattern, other, (FOLDER / "smooth-edge.toml").read_text(encoding="utf-8"), count=1
    )
    assert count == 1
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ProblemError, match=re.escape(message)) as error:
        read_problem(tmp_path / "mine.toml")
    assert str(error.value).startswith("mine.toml: ")
