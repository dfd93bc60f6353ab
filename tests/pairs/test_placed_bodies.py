"""Several bodies in a scene, each with a mesh of its own that is turned and moved to its place."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, rectangle_mesh
from scipy.linalg import expm
from two_bodies import assembled, grid

from signorini_fx import MeshError, SceneError, solve
from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD
OVERLAP = 0.001
CELLS = {"quadrilateral": 2, "triangle": 2, "hexahedron": 3}


def meshes(cell):
    """The generated meshes of two blocks of the size one, the upper one finer, both from the
    origin.
    """
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


def scene(
    cell,
    bodies,
    turn,
    boundaries=("upper.bottom", "lower.top", "lower.bottom", "upper.top"),
    **more,
):
    """A stiff block on a soft one, which is held below; pushed and sheared on its top, in
    directions that turn.
    """
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
            "contact": {"boundary": slave, "against": master, "friction": coulomb_friction(0.3)},
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
    blocks = [
        grid(cell, (n,) * dim, low * up, ones + low * up)
        for n, low in ((3, 0.0), (4, 1.0 - OVERLAP))
    ]
    heights = {
        "lower.bottom": 0.0,
        "lower.top": 1.0,
        "upper.bottom": 1.0 - OVERLAP,
        "upper.top": 2.0 - OVERLAP,
    }
    return tag_boundaries(
        assembled(cell, *blocks, comm=comm),
        {
            name: lambda x, h=h: np.isclose(x[dim - 1], h, rtol=0, atol=1e-9)
            for name, h in heights.items()
        },
    )


def with_regions(tagged):
    """The same mesh with the lower and the upper block as regions."""
    mesh, dim = tagged.mesh, tagged.dimension
    cells = mesh.topology.index_map(dim)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    tags = 1 + (dmesh.compute_midpoints(mesh, dim, every)[:, dim - 1] > 1.0).astype(np.int32)
    return replace(
        tagged, cell_tags=dmesh.meshtags(mesh, dim, every, tags), regions={"lower": 1, "upper": 2}
    )


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("cell", ["quadrilateral", "hexahedron"])
def test_the_same_as_one_mesh(cell):
    """Two blocks, the upper one moved to its place: every displacement is that of the same blocks
    as one mesh, on any number of ranks.  Turned about an axis, in 2D one of them upside down in
    addition, they turn it.
    """
    dim = CELLS[cell]
    lower, upper = (
        {"name": name, "mesh": mesh}
        for name, mesh in zip(("lower", "upper"), meshes(cell), strict=True)
    )
    up = (1.0 - OVERLAP) * np.eye(dim)[-1]
    straight = scene(cell, [lower, {**upper, "shift": up.tolist()}], np.eye(dim))
    x, u = at_nodes(solve(straight, WORLD))
    size = np.abs(u).max()
    reference = straight.model_copy(
        update={"mesh": with_regions(one_mesh(cell, WORLD)), "body": ()}
    )
    there, moved = at_nodes(solve(reference, WORLD))
    assert_allclose(x, there, rtol=0, atol=1e-12)
    assert_allclose(u, moved, rtol=0, atol=1e-12)

    if dim == 2:
        rotation, spin = 30.0, np.radians(30.0) * np.array([[0.0, -1.0], [1.0, 0.0]])
        turn, pivot = expm(spin), np.array([0.5, 0.5])
        upper |= {
            "rotation": 210.0,
            "pivot": pivot.tolist(),
            "shift": (turn @ (pivot + up) - pivot).tolist(),
        }
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
    assert_allclose((there @ turn)[order], x, rtol=0, atol=1e-12)
    assert_allclose((moved @ turn)[order], u, rtol=0, atol=1e-8 * size)


@pytest.mark.one_quick(("cell", "kind"), [("quadrilateral", "full"), ("hexahedron", "krylov")])
def test_a_sequence_of_meshes(cell, kind):
    """The generators of both bodies make coarser meshes, which change nothing but the work."""
    bodies = [
        {"name": n, "mesh": mesh} for n, mesh in zip(("lower", "upper"), meshes(cell), strict=True)
    ]
    for body in bodies:
        counts = body["mesh"]["parameters"]
        counts |= {key: 2 * value for key, value in counts.items() if key in ("nx", "ny", "nz")}
    bodies[1]["shift"] = ((1.0 - OVERLAP) * np.eye(CELLS[cell])[-1]).tolist()
    alone, levels = (
        solve(
            scene(cell, bodies, np.eye(CELLS[cell]), solver={"levels": k, "linear_algebra": kind})
        )
        for k in (1, 2)
    )
    assert [level.dofs for level in levels.levels][-1] == alone.model.dofs
    assert levels.levels[0].dofs < alone.model.dofs / 3
    size = alone.contact.pressure.max()
    assert_allclose(levels.contact.pressure, alone.contact.pressure, rtol=0, atol=1e-6 * size)


MATERIAL = {"young": 1.0, "poisson": 0.3}


ONE = rectangle_mesh(2, 2)
BOTH = [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": ONE, "shift": [0.0, 1.0]}]
ON_EACH_OTHER = {"boundary": "b.bottom", "against": "a.top"}


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"body": [], "material": MATERIAL}, "mesh is missing"),
        (
            {"mesh": ONE, "body": [{"name": "a", "mesh": ONE}]},
            r"mesh: leave it out: each \[\[body\]\] has its own",
        ),
        (
            {"body": [{"name": "a", "mesh": ONE}, {"name": "a", "mesh": ONE}]},
            r"body\[1\].name: two bodies are called 'a'",
        ),
        ({"body": [{"name": "a.b", "mesh": ONE}]}, r"body\[0\].name: must be a name without dots"),
        ({"body": [{"name": "a"}]}, r"body\[0\].mesh: is missing"),
        ({"body": {"name": "a", "mesh": {}}}, "body.mesh: give either file or generator"),
        ({"body": {"name": "a", "mesh": ONE, "turn": 1}}, "body.turn: unknown key"),
        (
            {
                "body": {"name": "a", "mesh": ONE},
                "accuracy": {"target": 0.1, "refinement": "adaptive"},
            },
            r"accuracy.refinement: is not possible for several \[\[body\]\]",
        ),
        (
            {"body": {"name": "a", "mesh": ONE, "shift": [0, 0, 1]}},
            r"body\[0\].shift: the mesh is plane: give 2",
        ),
        (
            {"body": {"name": "a", "mesh": ONE, "rotation": [0, 0, 1]}},
            r"body\[0\].rotation: the mesh is plane",
        ),
        (
            {"body": {"name": "a", "mesh": {"generator": "blob"}}},
            r"body\[0\].mesh.generator: no generator 'blob'",
        ),
        ({"body": {"name": "a", "mesh": {"file": "no.msh"}}}, "body 'a': mesh.file: no.msh"),
        (
            {"body": [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": {"generator": "box"}}]},
            "body 'b' has hexahedra",
        ),
        (
            {
                "body": [{"name": "a", "mesh": ONE}, {"name": "b", "mesh": ONE}],
                "contact": {"boundary": "top"},
            },
            "a.top",
        ),
        # A material of one body is not that of the other, which was the case in silence.
        (
            {"body": BOTH, "material": {**MATERIAL, "region": "a"}, "contact": ON_EACH_OTHER},
            "material: 4 cells of 'b'",
        ),
        (
            {"body": BOTH, "contact": [ON_EACH_OTHER, ON_EACH_OTHER]},
            r"contact\[1\]: boundary '\S+' is in contact twice: name it as against",
        ),
        (
            {"body": {"name": "a", "mesh": ONE}, "contact": 2 * [{"boundary": "top", "gap": 0.0}]},
            r"contact\[1\]: boundary 'top' is in contact twice: name the part that each",
        ),
        (
            {"body": BOTH, "contact": {**ON_EACH_OTHER, "gap": "1/(x[0] - x[0])"}},
            r"contact\[0\].gap: is inf at",
        ),
    ],
)
def test_what_is_refused(given, match):
    """Each mistake by its path."""
    contact = {"contact": {"boundary": "bottom"}}
    with pytest.raises((SceneError, MeshError), match=match):
        solve(parse_scene({"material": MATERIAL, **contact, **given}), MPI.COMM_SELF)
