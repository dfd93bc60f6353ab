"""Several bodies in a scene, each with a mesh of its own that is turned and moved to its place."""

from dataclasses import replace

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.linalg import expm
from two_bodies import assembled, grid

from signorini_fx import MeshError, SceneError, solve
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.summary import summarise
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD
OVERLAP = 0.001
CELLS = {"quadrilateral": 2, "triangle": 2, "hexahedron": 3}


def meshes(cell):
    """The generated meshes of two blocks of the size one, the upper one finer, both from the origin."""
    if CELLS[cell] == 2:
        generator, names, sizes = "rectangle", ("nx", "ny"), ("length", "height")
    else:
        generator, names, sizes = "box", ("nx", "ny", "nz"), ("length", "width", "height")
    return [
        {
            "generator": generator,
            "parameters": {"cell": cell, **dict.fromkeys(names, n), **dict.fromkeys(sizes, 1.0)},
        }
        for n in (3, 4)
    ]


def turned(given, turn):
    """The components of a vector after a rotation."""
    return dict(zip("xyz", turn @ np.array(given), strict=False))


def scene(cell, bodies, turn, boundaries=("upper.bottom", "lower.top", "lower.bottom", "upper.top"), **more):
    """A stiff block on a soft one, which is held below; pushed and sheared on its top, in directions that turn."""
    dim = CELLS[cell]
    slave, master, bottom, top = boundaries
    pull, shear = -np.eye(dim)[-1], np.eye(dim)[0]
    return parse_scene(
        {
            "body": bodies,
            "material": [
                {"young": 300.0, "poisson": 0.3, "region": "upper"},
                {"young": 100.0, "poisson": 0.3, "region": "lower"},
            ],
            "displacement": {"boundary": bottom, **dict.fromkeys("xyz"[:dim], 0.0)},
            "traction": {"boundary": top, **turned(0.3 * pull + 0.05 * shear, turn)},
            "contact": {"boundary": slave, "against": master, "friction": {"law": "coulomb", "coefficient": 0.3}},
            **more,
        }
    )


def at_nodes(solution):
    """Positions and displacements of the nodes of all ranks, sorted by place."""
    space = solution.displacement.function_space
    dim, owned = space.mesh.geometry.dim, space.dofmap.index_map.size_local
    rows = np.column_stack(
        (
            space.tabulate_dof_coordinates()[:owned, :dim],
            solution.displacement.x.array.reshape(-1, dim)[:owned],
        )
    )
    rows = parallel.gather_rows(space.mesh.comm, rows)
    rows = rows[np.lexsort(np.round(rows[:, :dim], 9).T)]
    return rows[:, :dim], rows[:, dim:]


def one_mesh(cell, comm):
    """The same blocks as one mesh with names."""
    dim = CELLS[cell]
    up, ones = np.eye(dim)[-1], np.ones(dim)
    blocks = [grid(cell, (n,) * dim, low * up, ones + low * up) for n, low in ((3, 0.0), (4, 1.0 - OVERLAP))]
    heights = {"lower.bottom": 0.0, "lower.top": 1.0, "upper.bottom": 1.0 - OVERLAP, "upper.top": 2.0 - OVERLAP}
    return tag_boundaries(
        assembled(cell, *blocks, comm=comm),
        {name: lambda x, h=h: np.isclose(x[dim - 1], h, rtol=0, atol=1e-9) for name, h in heights.items()},
    )


def with_regions(tagged):
    """The same mesh with the lower and the upper block as regions."""
    mesh, dim = tagged.mesh, tagged.dimension
    cells = mesh.topology.index_map(dim)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    tags = 1 + (dmesh.compute_midpoints(mesh, dim, every)[:, dim - 1] > 1.0).astype(np.int32)
    return replace(tagged, cell_tags=dmesh.meshtags(mesh, dim, every, tags), regions={"lower": 1, "upper": 2})


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_the_same_as_one_mesh(cell):
    """Two blocks, the upper one moved to its place: every displacement is that of the same blocks as one mesh, on any
    number of ranks.  Turned about an axis, in 2D one of them upside down in addition, they turn it.
    """
    dim = CELLS[cell]
    lower, upper = ({"name": name, "mesh": mesh} for name, mesh in zip(("lower", "upper"), meshes(cell), strict=True))
    up = (1.0 - OVERLAP) * np.eye(dim)[-1]
    straight = scene(cell, [lower, {**upper, "shift": up.tolist()}], np.eye(dim))
    x, u = at_nodes(solve(straight, WORLD))
    size = np.abs(u).max()
    reference = straight.model_copy(update={"mesh": with_regions(one_mesh(cell, WORLD)), "body": ()})
    there, moved = at_nodes(solve(reference, WORLD))
    np.testing.assert_allclose(x, there, rtol=0, atol=1e-12)
    np.testing.assert_allclose(u, moved, rtol=0, atol=1e-12)

    if dim == 2:
        rotation, spin = 30.0, np.radians(30.0) * np.array([[0.0, -1.0], [1.0, 0.0]])
        turn, pivot = expm(spin), np.array([0.5, 0.5])
        upper |= {"rotation": 210.0, "pivot": pivot.tolist(), "shift": (turn @ (pivot + up) - pivot).tolist()}
        names = ("upper.top", "lower.top", "lower.bottom", "upper.bottom")
    else:
        rotation = [20.0, -30.0, 10.0]
        a, b, c = np.radians(rotation)
        turn = expm(np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]))
        upper |= {"rotation": rotation, "shift": (turn @ up).tolist()}
        names = ("upper.bottom", "lower.top", "lower.bottom", "upper.top")
    skew = scene(cell, [{**lower, "rotation": rotation}, upper], turn, names)
    there, moved = at_nodes(solve(skew, WORLD))
    order = np.lexsort(np.round(there @ turn, 9).T)
    np.testing.assert_allclose((there @ turn)[order], x, rtol=0, atol=1e-12)
    np.testing.assert_allclose((moved @ turn)[order], u, rtol=0, atol=1e-8 * size)


@pytest.mark.one_quick
@pytest.mark.parametrize(("cell", "kind"), [("quadrilateral", "full"), ("hexahedron", "krylov")])
def test_a_sequence_of_meshes(cell, kind):
    """The generators of both bodies make coarser meshes, which change nothing but the work."""
    bodies = [{"name": n, "mesh": mesh} for n, mesh in zip(("lower", "upper"), meshes(cell), strict=True)]
    for body in bodies:
        counts = body["mesh"]["parameters"]
        counts |= {key: 2 * value for key, value in counts.items() if key in ("nx", "ny", "nz")}
    bodies[1]["shift"] = ((1.0 - OVERLAP) * np.eye(CELLS[cell])[-1]).tolist()
    alone, levels = (
        solve(scene(cell, bodies, np.eye(CELLS[cell]), solver={"levels": k, "linear_algebra": kind})) for k in (1, 2)
    )
    assert [level.dofs for level in levels.levels][-1] == alone.model.dofs
    assert levels.levels[0].dofs < alone.model.dofs / 3
    size = alone.contact.pressure.max()
    np.testing.assert_allclose(levels.contact.pressure, alone.contact.pressure, rtol=0, atol=1e-6 * size)


@pytest.mark.slow
@pytest.mark.mpi
def test_names_of_curved_bodies():
    """Curved cells, boundaries and regions keep their names and measures."""
    disk = {"generator": "half_disk", "parameters": {"order": 2, "size": 0.3, "contact_size": 0.1}}
    alone = load_mesh(parse_scene({"mesh": disk, "material": MATERIAL}), WORLD)
    bodies = [{"name": "one", "mesh": disk}, {"name": "two", "mesh": disk, "shift": [0.0, -3.0], "rotation": 90.0}]
    found = load_mesh(parse_scene({"body": bodies, "material": MATERIAL, "element": {"degree": 2}}), WORLD)
    assert set(found.boundaries) == {f"{body}.{name}" for body in ("one", "two") for name in alone.boundaries}
    for name in alone.boundaries:
        expected = measure(alone, name)
        assert measure(found, f"one.{name}") == pytest.approx(expected, rel=1e-12)
        assert measure(found, f"two.{name}") == pytest.approx(expected, rel=1e-12)
    assert {"one", "two"} <= set(found.regions)


MATERIAL = {"young": 1.0, "poisson": 0.3}


def measure(tagged, name):
    """The length of a boundary."""
    mesh = tagged.mesh
    facets = tagged.facets(name)
    tags = dmesh.meshtags(mesh, 1, facets, np.ones(facets.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)
    found = fem.assemble_scalar(fem.form(fem.Constant(mesh, 1.0) * ds(1)))
    return parallel.global_sum(mesh.comm, np.array(found))


ONE = {"generator": "rectangle", "parameters": {"nx": 2, "ny": 2}}
BOTH = [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": ONE, "shift": [0.0, 1.0]}]
ON_EACH_OTHER = {"boundary": "b.bottom", "against": "a.top"}


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"body": [], "material": MATERIAL}, "mesh: is missing"),
        ({"mesh": ONE, "body": [{"name": "a", "mesh": ONE}]}, r"mesh: leave it out: each \[\[body\]\] has its own"),
        (
            {"body": [{"name": "a", "mesh": ONE}, {"name": "a", "mesh": ONE}]},
            r"body\[1\].name: two bodies are called 'a'",
        ),
        ({"body": [{"name": "a.b", "mesh": ONE}]}, r"body\[0\].name: must be a name without dots"),
        ({"body": [{"name": "a"}]}, r"body\[0\].mesh: is missing"),
        ({"body": {"name": "a", "mesh": {}}}, "body.mesh: give either file or generator"),
        ({"body": {"name": "a", "mesh": ONE, "turn": 1}}, "body.turn: unknown key"),
        (
            {"body": {"name": "a", "mesh": ONE}, "accuracy": {"target": 0.1, "refinement": "adaptive"}},
            r"accuracy.refinement: is not possible for several \[\[body\]\]",
        ),
        ({"body": {"name": "a", "mesh": ONE, "shift": [0, 0, 1]}}, r"body\[0\].shift: the mesh is plane: give 2"),
        ({"body": {"name": "a", "mesh": ONE, "rotation": [0, 0, 1]}}, r"body\[0\].rotation: the mesh is plane"),
        ({"body": {"name": "a", "mesh": {"generator": "blob"}}}, r"body\[0\].mesh.generator: no generator 'blob'"),
        ({"body": {"name": "a", "mesh": {"file": "no.msh"}}}, "body 'a': mesh.file: no.msh"),
        (
            {"body": [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": {"generator": "box"}}]},
            "body 'b' has hexahedra, body 'a' quadrilaterals: a mesh has one kind of cell",
        ),
        ({"body": [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": ONE}], "contact": {"boundary": "top"}}, "a.top"),
        # A material of one body is not that of the other, which was the case in silence.
        (
            {"body": BOTH, "material": {**MATERIAL, "region": "a"}, "contact": ON_EACH_OTHER},
            "material: 4 cells of 'b' are in none of the regions that have a material",
        ),
        (
            {"body": BOTH, "contact": [ON_EACH_OTHER, ON_EACH_OTHER]},
            r"contact\[1\]: boundary '\S+' is in contact twice: name it as against, and the others as boundary",
        ),
        ({"body": BOTH, "contact": {**ON_EACH_OTHER, "gap": "1/(x[0] - x[0])"}}, r"contact\[0\].gap: is inf at"),
    ],
)
def test_what_is_refused(given, match):
    """Each mistake by its path."""
    contact = {"contact": {"boundary": "bottom"}}
    with pytest.raises((SceneError, MeshError), match=match):
        solve(parse_scene({"material": MATERIAL, **contact, **given}), MPI.COMM_SELF)


def stacked(names, *contact, young, **more):
    """Plates of the length 4 on each other, from the first below to the last, with each contact between neighbours."""
    plate = {"generator": "rectangle", "parameters": {"length": 4.0, "height": 1.0, "nx": 4, "ny": 1}}
    return parse_scene(
        {
            "body": [{"name": name, "mesh": plate, "shift": [0.0, k]} for k, name in enumerate(names)],
            "material": [{"young": e, "poisson": 0.3, "region": name} for name, e in zip(names, young, strict=True)],
            "displacement": {"boundary": f"{names[0]}.bottom", "x": 0.0, "y": 0.0},
            "traction": {"boundary": f"{names[-1]}.top", "pressure": 1.0},
            "contact": [
                {"boundary": f"{above}.bottom", "against": f"{below}.top", **one}
                for below, above, one in zip(names, names[1:], contact, strict=False)
            ],
            **more,
        }
    )


def said(given):
    """Paths and messages of ``check``."""
    return [(one.path, one.message) for one in check_scene(given, MPI.COMM_SELF).findings]


def test_bodies_by_their_names():
    """Messages and the summary call a body by the name that the scene gives it, not by where it lies."""
    free = stacked(("z table", "a cup"), {}, young=(100.0, 100.0))
    listed, held = (dict(said(free))[path] for path in ("mesh", "displacement"))
    assert "body 'z table' (4 cells, x[0] 0 to 4, x[1] 0 to 1); body 'a cup' (4 cells" in listed
    assert "nor the contact resists body 'a cup' in the translation along (1, 0); prescribe" in held
    assert "z table" not in held
    friction = {"friction": {"law": "coulomb", "coefficient": 0.3}}
    solution = solve(stacked(("z table", "a cup"), friction, young=(100.0, 100.0)), MPI.COMM_SELF)
    summary = summarise(solution)
    assert [row["body"] for row in summary["pieces"]] == ["z table", "a cup"]


def test_bodies_in_several_pieces():
    """A body whose mesh falls apart has a name that is no piece's, which are numbered."""
    low, high = ([[0.0, 0.0], [1.0, 1.0]], [[3.0, 0.0], [4.0, 1.0]])
    points = np.array([[[x, y] for x in (a[0], b[0]) for y in (a[1], b[1])] for a, b in (low, high)])
    straight = ufl.Mesh(basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,)))
    cells = np.arange(8, dtype=np.int64).reshape(2, 4)
    halves = dmesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points.reshape(8, 2), e=straight)
    bodies = [{"name": "feet", "mesh": tag_boundaries(halves, {"soles": "x[1] < 1e-9", "tops": "x[1] > 1 - 1e-9"})}]
    bodies.append({"name": "top", "mesh": stacked(("a",), young=(1.0,)).body[0].mesh, "shift": [0.0, 1.0]})
    contact = {"boundary": "tops", "against": "top.bottom"}
    given = {"body": bodies, "material": MATERIAL, "contact": contact}
    findings = dict(said(parse_scene({**given, "displacement": {"boundary": "top.top", "x": 0.0, "y": 0.0}})))
    assert "piece 1 of 3, in body 'feet' (1 cell, x[0] 0 to 1" in findings["displacement"]
    assert "; body 'top' (4 cells" in findings["mesh"]


def test_what_bonds_hold():
    """A bonded body needs no friction, and no load that presses it on."""
    friction = {"friction": {"law": "coulomb", "coefficient": 0.3}}
    glued = stacked(("low", "middle"), {"kind": "bonded"}, young=(100.0, 100.0))
    message = "the supports do not hold body 'middle' in translations and rotations: bonds do"
    assert ("displacement", message) in said(glued)
    on_it = stacked(("low", "middle", "high"), {"kind": "bonded"}, friction, young=(100.0,) * 3)
    held = dict(said(on_it))["displacement"]
    assert "the supports and bonds do not hold body 'high' in translations and rotations: friction must" in held
    assert "'middle'" not in held


def test_a_soft_layer_is_no_beam():
    """Between stiff plates it is compressed by a tenth; a beam of its material would bend by more than its size."""
    bond = {"kind": "bonded"}
    layers = stacked(("low", "middle", "high"), bond, bond, young=(1e5, 10.0, 1e5))
    assert not [message for _, message in said(layers) if "the deformation is not small" in message]
    soft = stacked(("low", "middle", "high"), bond, bond, young=(1.0, 1.0, 1.0))
    assert [message for _, message in said(soft) if "the deformation is not small" in message]


def test_an_expression_cannot_tell_both_sides():
    """Where two bodies lie on each other it finds the facets of both, and the message says what to do."""
    placed = load_mesh(parse_scene({"body": BOTH, "material": MATERIAL, "contact": ON_EACH_OTHER}), MPI.COMM_SELF)
    tagged = tag_boundaries(placed.mesh, dict.fromkeys(("high", "low"), "abs(x[1] - 1) < 1e-9"))
    given = parse_scene({"mesh": tagged, "material": MATERIAL, "contact": {"boundary": "high", "against": "low"}})
    with pytest.raises(SceneError, match=r"'low' shares 4 facets with .* 'high': .* take names of the mesh file"):
        solve(given, MPI.COMM_SELF)


def test_pictures_of_nodes_that_coincide():
    """Nodes of two bodies at the same place are two points, and apart by the relative displacement of the contact."""
    from signorini_fx.addons.picture_data.outer_surface import gather_outer_surface

    cube = {"generator": "box", "parameters": dict.fromkeys(("length", "width", "height"), 1.0)}
    cube["parameters"] |= dict.fromkeys(("nx", "ny", "nz"), 2)
    bodies = [{"name": "upper", "mesh": cube, "shift": [0.0, 0.0, 1.0]}, {"name": "lower", "mesh": cube}]
    sides = ("upper.bottom", "lower.top", "lower.bottom", "upper.top")
    solution = solve(scene("hexahedron", bodies, np.eye(3), sides, solver={"gamma_n": 1e4, "gamma_t": 1e3}), WORLD)
    assert solution.converged
    body, table = gather_outer_surface(solution), solution.table.columns
    if WORLD.rank > 0:
        return
    assert set(table["boundary"]) == {"lower.top"}  # the points are on the softer body
    nodes = np.column_stack([table[axis] for axis in "xyz"])
    assert len(nodes) == 9
    there = np.linalg.norm(body.points[None] - nodes[:, None], axis=2) < 1e-9
    highest = [body.points[body.pieces == piece, 2].max() for piece in (0, 1)]
    lower, upper = (np.argmax(there & (body.pieces == piece), axis=1) for piece in np.argsort(highest))
    wanted = np.column_stack([table[f"u_t_{axis}"] for axis in "xy"])
    assert np.abs(wanted).max() > 1e-4
    apart = body.displacement[lower, :2] - body.displacement[upper, :2]
    np.testing.assert_allclose(apart, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


PRESSED = {
    "material": {"young": 1000.0, "poisson": 0.3},
    "displacement": [{"boundary": "low.bottom", "x": 0.0, "y": 0.0}, {"boundary": "high.top", "x": 0.0, "y": -0.01}],
}


@pytest.mark.parametrize(
    ("low", "high", "cell"),
    [
        ({}, {}, "quadrilateral"),
        ({"cell": "triangle"}, {}, "triangle"),
        ({}, {"cell": "triangle"}, "triangle"),
    ],
)
def test_generators_agree_on_a_kind_of_cell(low, high, cell):
    """Of generators with other defaults all make the cells that one is given, or else those of the first."""
    bodies = [
        {"name": "low", "mesh": {"generator": "rectangle", "parameters": {"length": 4.0, "height": 1.0, **low}}},
        {"name": "high", "mesh": {"generator": "punch", "parameters": {"size": 0.8, **high}}, "shift": [2.0, 1.0]},
    ]
    given = parse_scene({**PRESSED, "body": bodies, "contact": {"boundary": "high.foot", "against": "low.top"}})
    assert load_mesh(given, MPI.COMM_SELF).mesh.topology.cell_name() == cell
    assert solve(given, MPI.COMM_SELF).converged


ARC = "Point(5) = {1, 0.3, 0, 0.4}; Circle(1) = {1, 5, 2};"
BLOCK = """
Point(1) = {0, 0, 0, 0.4}; Point(2) = {2, 0, 0, 0.4}; Point(3) = {2, 1, 0, 0.4}; Point(4) = {0, 1, 0, 0.4};
Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
Physical Curve("bottom") = {1}; Physical Curve("top") = {3}; Physical Surface("body") = {1};
"""


def test_a_curved_drawing_and_a_straight_one(tmp_path):
    """Elements of degree 2 are on the arc of one body, and the other one gets nodes between its corners."""
    beginning, end = BLOCK.split("\nLine(2)")
    for name, line in (("straight", "Line(1) = {1, 2};"), ("curved", ARC)):
        (tmp_path / f"{name}.geo").write_text(f"{beginning}\n{line} Line(2){end}")
    bodies = [
        {"name": "low", "mesh": {"file": tmp_path / "straight.geo"}},
        {"name": "high", "mesh": {"file": tmp_path / "curved.geo"}, "shift": [0.0, 1.8]},
    ]
    contact = {"boundary": "high.bottom", "against": "low.top", "gap": 0.0}
    given = parse_scene({**PRESSED, "element": {"degree": 2}, "body": bodies, "contact": contact})
    tagged = load_mesh(given, MPI.COMM_SELF)
    assert compat.geometry_degree(tagged.mesh) == 2
    # A segment of a circle through (0, 0) and (2, 0) with its centre above is below the upper block.
    half = np.arctan2(1.0, 0.3)
    segment = (1.0 + 0.3**2) * (half - np.sin(half) * np.cos(half))
    size = fem.assemble_scalar(fem.form(fem.Constant(tagged.mesh, 1.0) * ufl.dx))
    assert size == pytest.approx(4.0 + segment, rel=1e-4)
    assert solve(given, MPI.COMM_SELF).status
