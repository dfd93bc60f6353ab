"""Forces at single nodes and links between them: exact states, statics, several ranks, and what is refused."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import box

from signorini_fx import ConvergenceError, SceneError
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, STIFF = 5000.0, 1e9
PLANE = {"triangle": dmesh.CellType.triangle, "quadrilateral": dmesh.CellType.quadrilateral}
ELEMENTS = [("quadrilateral", 1), ("triangle", 2), ("hexahedra", 1), ("tetrahedra", 2)]


def body(cells, comm=COMM):
    """A block from the origin, 2 long and 1 high, in space 1 wide."""
    if cells not in PLANE:
        return box(cells, (2, 2, 2), size=(2.0, 1.0, 1.0), comm=comm)
    mesh = dmesh.create_rectangle(comm, [(0.0, 0.0), (2.0, 1.0)], (4, 2), PLANE[cells])
    near = {"left": (0, 0.0), "right": (0, 2.0), "bottom": (1, 0.0)}
    return tag_boundaries(
        mesh, {name: lambda x, k=k, at=at: np.abs(x[k] - at) < 1e-9 for name, (k, at) in near.items()}
    )


def ends(cells, degree):
    """The nodes of the right end of the block."""
    y = np.linspace(0.0, 1.0, 2 * degree + 1)
    return [(2.0, a) for a in y] if cells in PLANE else [(2.0, a, b) for a in y for b in y]


def flat_end(folder, cells, degree):
    """Links that keep the right end flat and upright."""
    first, *others = ends(cells, degree)
    axes = "xyz"[: len(first)]
    lines = [",".join(["link", *axes, *(f"c{axis}" for axis in axes)])]
    for number, point in enumerate(others, 1):
        for place, sign in ((point, 1), (first, -1)):
            lines.append(",".join(map(str, (number, *place, sign, *(0,) * (len(axes) - 1)))))
    file = folder / f"links{COMM.rank}.csv"
    file.write_text("\n".join(lines) + "\n")
    return {"file": str(file), "stiffness": STIFF}


def pulled(folder, cells, degree, comm=COMM, **more):
    """The block pulled at one node of its flat end, without Poisson's effect."""
    dim = 2 if cells in PLANE else 3
    held = [{"boundary": "left", "x": 0.0}, {"at": [0.0] * dim, "y": 0.0, **({"z": 0.0} if dim == 3 else {})}]
    held += [{"at": [0.0, 1.0, 0.0], "z": 0.0}] if dim == 3 else []
    entries = {"displacement": held, "links": flat_end(folder, cells, degree), **more}
    material = {"young": YOUNG, "poisson": 0.0}
    return parse_scene({"mesh": body(cells, comm), "element": {"degree": degree}, "material": material, **entries})


@pytest.mark.mpi
@pytest.mark.parametrize(("cells", "degree"), ELEMENTS)
def test_a_bar_with_a_flat_end(tmp_path, cells, degree):
    """A force at one node of it stretches the bar as by an even traction, F L / E A, in all of its nodes."""
    force = {"at": list(ends(cells, degree)[1]), "x": 7.0}
    solution = solve(pulled(tmp_path, cells, degree, point_force=force))
    space = solution.displacement.function_space
    x = space.tabulate_dof_coordinates()
    u = solution.displacement.x.array.reshape(len(x), -1)
    along = u[:, 0][np.abs(x[:, 0] - 2.0) < 1e-9]
    np.testing.assert_allclose(along, 7.0 * 2.0 / YOUNG, rtol=1e-5)
    assert solution.certificate.worst < 1e-7
    assert solution.resultants.of("left").force[0] == pytest.approx(-7.0, rel=1e-9)


def test_a_broken_link_is_refused(tmp_path):
    """The certificate sees a node that leaves its link by 1e-5 of its displacement, and a force that is left out."""
    force = {"at": list(ends("quadrilateral", 1)[1]), "x": 7.0}
    solution = solve(pulled(tmp_path, "quadrilateral", 1, MPI.COMM_SELF, point_force=force))
    model, moved = solution.model, solution.displacement.copy()
    assert certify(model.statement, model.tagged, moved, None).holds
    node = np.argmin(np.linalg.norm(moved.function_space.tabulate_dof_coordinates() - (2.0, 1.0, 0.0), axis=1))
    moved.x.array[2 * node] *= 1 + 1e-5
    assert not certify(model.statement, model.tagged, moved, None).holds
    without = model.statement.changed(point_force=())
    assert not certify(without, model.tagged, solution.displacement, None).holds


def test_a_table_of_forces(tmp_path):
    """Forces of a file are those of as many entries; load steps multiply them."""
    places = [(2.0, 0.5), (1.0, 1.0)]
    vectors = [(1.0, -2.0), (0.5, 3.0)]
    file = tmp_path / "forces.csv"
    rows = [",".join(map(str, (*place, *vector))) for place, vector in zip(places, vectors, strict=True)]
    file.write_text("\n".join(["x,y,fx,fy", *rows]) + "\n")
    single = [{"at": list(at), "x": fx, "y": fy} for at, (fx, fy) in zip(places, vectors, strict=True)]
    table = solve(pulled(tmp_path, "triangle", 2, MPI.COMM_SELF, point_force={"file": str(file), "factors": [2.0]}))
    one_by_one = solve(pulled(tmp_path, "triangle", 2, MPI.COMM_SELF, point_force=single))
    np.testing.assert_allclose(table.displacement.x.array, 2 * one_by_one.displacement.x.array, atol=1e-12)
    assert table.resultants.of("left").force[0] == pytest.approx(-3.0, rel=1e-9)


def test_links_join_bodies(tmp_path):
    """Two blocks that only links hold together move as one; without one of these the free motion is named."""
    corners = [(1.0, 0.0), (1.0, 1.0)]

    def scene(linked):
        mesh = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 1, "ny": 1}}
        bodies = [{"name": name, "mesh": mesh, "shift": [at, 0.0]} for name, at in (("a", 0.0), ("b", 1.0))]
        lines, number = ["link,x,y,cx,cy,region"], 0
        for point in corners[:linked]:
            for vector in ("1,0", "0,1"):
                number += 1
                minus = vector.replace("1", "-1")
                lines += [f"{number},{point[0]},{point[1]},{vector},a", f"{number},{point[0]},{point[1]},{minus},b"]
        file = tmp_path / f"links{linked}.csv"
        file.write_text("\n".join(lines) + "\n")
        return parse_scene(
            {
                "body": bodies,
                "material": {"young": YOUNG, "poisson": 0.0},
                "displacement": [{"boundary": "a.left", "x": 0.0, "y": 0.0}],
                "traction": {"boundary": "b.right", "x": 6.0},
                "links": {"file": str(file), "stiffness": STIFF},
            }
        )

    solution = solve(scene(2))
    assert solution.displacement.x.array[::2].max() == pytest.approx(6.0 * 2.0 / YOUNG, rel=1e-5)
    with pytest.raises(ConvergenceError, match="rotation about"):
        solve(scene(1), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("x,y,fx,fy\n9.,0.,1.,1.", "no node of the mesh is at (9, 0)"),
        ("x,y,fx\n0.,0.,1.", "it needs x, y, fx, fy"),
        ("x,y,fx,fy\n0.,0.,1.", "row 2 has 3 entries for 4 columns"),
        ("x,y,fx,fy\n0.,0.,1.,nan", "not finite"),
        ("x,y,fx,fy\n0.,0.,1.,one", "an entry that is no number"),
        ("x,y,fx,fy", "0 rows"),
        ("x,y,fx,fy,region\n0.,0.,1.,1.,elsewhere", "the mesh has no region 'elsewhere'"),
        ("x,y,z,fx,fy,fz\n0.,0.,0.,1.,1.,1.", "has 3 coordinates, the mesh has 2"),
        (None, "cannot be read"),
    ],
)
def test_tables_that_are_wrong(tmp_path, table, message):
    """One error with the path of the entry, and what is wrong."""
    file = tmp_path / "forces.csv"
    if table is not None:
        file.write_text(table + "\n")
    with pytest.raises(SceneError) as error:
        solve(pulled(tmp_path, "quadrilateral", 1, MPI.COMM_SELF, point_force={"file": str(file)}))
    assert "point_force[0]" in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
