"""Meshes of one's own: their boundaries, gmsh that is open already, drawings, what is no mesh."""

from pathlib import Path

import gmsh
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scenes import alone

from signorini_fx.errors import MeshError
from signorini_fx.machine.compat import geometry_degree
from signorini_fx.mechanics.mesh.tagged import generate_mesh, gmsh_mesh, read_mesh, tag_boundaries
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

COMM, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
DEMOS = Path(__file__).parents[2] / "demos" / "scenes"


@pytest.mark.mpi
def test_markers_that_share_facets():
    """A facet belongs to every boundary whose marker holds on it, whichever markers come first, on
    all ranks.
    """
    square = mesh.create_unit_square(COMM, 4, 4)
    markers = {
        "low": "x[1] < 1e-9",
        "corner": lambda x: (x[1] < 1e-9) & (x[0] < 0.51),
        "nothing": "x[0] - 5",
    }
    markers |= {"all": lambda x: x[0] > -1, "right": "x[0] > 1 - 1e-9"}
    expected = {"low": 4, "corner": 2, "nothing": 0, "all": 16, "right": 4}
    for names in (list(markers), list(markers)[::-1]):
        tagged = tag_boundaries(square, {name: markers[name] for name in names})
        assert COMM.bcast(tagged.boundaries) == tagged.boundaries
        assert {name: COMM.allreduce(len(tagged.facets(name))) for name in names} == {
            n: expected[n] for n in names
        }
    assert tag_boundaries(square, {}).boundaries == {}


def test_forces_on_boundaries_that_overlap():
    """Pressure 3 on all of the top and 1 more on its right half: the foundation bears both, 3 * 2 +
    1 * 1.
    """
    own = mesh.create_rectangle(SELF, [[0.0, 0.0], [2.0, 1.0]], [8, 4], mesh.CellType.quadrilateral)
    sides = {
        "side": "x[0] < 1e-9",
        "low": "x[1] < 1e-9",
        "right of the top": lambda x: (x[1] > 0.99) & (x[0] > 0.99),
    }
    data = {
        "mesh": tag_boundaries(own, sides | {"top": "x[1] > 0.99"}),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "side", "x": 0.0},
        "traction": [{"boundary": "top", "y": -3.0}, {"boundary": "right of the top", "y": -1.0}],
        "contact": {"boundary": "low"},
    }
    table = alone(parse_scene(data)).table.columns
    assert (table["pressure"] * table["weight"]).sum() == pytest.approx(7.0, rel=1e-9)


def test_gmsh_that_is_open_already():
    """Meshes are the same within a session of the caller, whose models and options stay."""

    def points():
        made = generate_mesh("punch", {}, SELF)
        drawn = read_mesh(DEMOS / "bolted_joint.geo", SELF)
        cad = read_mesh(DEMOS / "lug_and_pin.step", SELF, size=6.0)
        return [tagged.mesh.geometry.x for tagged in (made, drawn, cad)]

    alone_in_gmsh = points()
    gmsh.initialize(readConfigFiles=False)
    try:
        own = {"Mesh.MeshSizeMax": 0.3, "Mesh.ElementOrder": 2.0, "General.Terminal": 0.0}
        for name, value in own.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("mine")
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        models, nodes = gmsh.model.list(), gmsh.model.mesh.getNodes()[0]
        for ours, beside in zip(alone_in_gmsh, points(), strict=True):
            np.testing.assert_array_equal(ours, beside)
        with pytest.raises(MeshError, match="gmsh cannot make the mesh"):
            gmsh_mesh(SELF, lambda session: session.model.mesh.generate("nothing"), "broken")
        assert (gmsh.model.getCurrent(), gmsh.model.list()) == ("mine", models)
        np.testing.assert_array_equal(gmsh.model.mesh.getNodes()[0], nodes)
        assert {name: gmsh.option.getNumber(name) for name in own} == own
    finally:
        gmsh.finalize()


# --- drawings -------------------------------------------------------------------------------------

DISK = """
Point(1) = {0, 0, 0, 0.5}; Point(2) = {1, 0, 0, 0.5}; Point(3) = {0, 1, 0, 0.5};
Line(1) = {1, 2}; Circle(2) = {2, 1, 3}; Line(3) = {3, 1}; Curve Loop(1) = {1:3}; Plane Surface(1) = {1}; MORE
Physical Curve("low") = {1}; Physical Curve("left") = {3}; Physical Curve("arc") = {2};
"""


@pytest.mark.parametrize(
    "more",
    [
        "",
        "Mesh.ElementOrder = 1;",
        "Mesh.ElementOrder = 2; Mesh.SecondOrderIncomplete = 1; Recombine Surface{1};",
    ],
)
def test_curved_scripts(tmp_path, more):
    """Elements of degree 2 get curved cells on the curves of a script, whatever order it names;
    others do not.
    """
    file = tmp_path / "disk.geo"
    file.write_text(DISK.replace("MORE", more))
    data = {
        "mesh": {"file": file},
        "material": {"young": 1.0, "poisson": 0.3},
        "contact": {"boundary": "low"},
    }
    curved = load_mesh(parse_scene(data | {"element": {"degree": 2}}), SELF)
    assert geometry_degree(curved.mesh) == 2
    one = fem.Constant(curved.mesh, 1.0)
    assert fem.assemble_scalar(fem.form(one * ufl.dx)) == pytest.approx(np.pi / 4, rel=2e-4)
    if "2" not in more.partition(";")[0]:
        straight = load_mesh(parse_scene(data), SELF)
        assert geometry_degree(straight.mesh) == 1
