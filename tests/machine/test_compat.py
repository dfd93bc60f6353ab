"""What the package changes in dolfinx and UFL for all."""

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from signorini_fx.machine import compat  # noqa: F401


@pytest.mark.parametrize("kind", ["interval", "triangle", "quadrilateral", "tetrahedron", "hexahedron", "prism"])
def test_elements_on_one_kind_of_cell_share_it(kind):
    cells = [basix.ufl.element("Lagrange", kind, degree, shape=shape).cell for degree, shape in ((1, ()), (2, (2,)))]
    assert cells[0] is cells[1]
    assert cells[0] == ufl.Cell(kind)
    assert [cells[0].num_sub_entities(d) for d in range(4)] == [ufl.Cell(kind).num_sub_entities(d) for d in range(4)]
    assert [str(face) for face in cells[0].sub_entities(0)] == [str(face) for face in ufl.Cell(kind).sub_entities(0)]


def test_few_cells_are_made_for_a_form(monkeypatch):
    domain = mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2, mesh.CellType.hexahedron)
    made, make = [], ufl.cell.Cell.__init__
    monkeypatch.setattr(ufl.cell.Cell, "__init__", lambda cell, name: (made.append(name), make(cell, name))[0])
    space = fem.functionspace(domain, ("Lagrange", 1, (3,)))
    u = fem.Function(space)
    u.interpolate(lambda x: x)
    value = fem.assemble_scalar(fem.form(ufl.inner(ufl.grad(u), ufl.grad(u)) * ufl.dx))
    assert np.isclose(value, 3.0)
    assert len(made) <= 300  # two hexahedra with all that they are made of
