"""Contact of two deformable bodies whose meshes do not match, in ``ContactProblem``."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import at_coordinate, no_load
from two_bodies import (
    KINDS,
    assembled,
    blocks,
    facets,
    facets_of_cells,
    facets_of_piece,
    forms,
    grid,
    held,
    on,
    paraboloids,
    per_cell,
    turn_of_blocks,
)

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    Pair,
    Status,
    Tresca,
)
from signorini_fx.machine import parallel

ELEMENTS = [(kind, degree) for kind in KINDS for degree in (1, 2)]


@pytest.mark.one_quick("exchanged", [False, True], ids=["", "exchanged"])
@pytest.mark.parametrize("law", ["bonded", "stick", "slip"])
@pytest.mark.parametrize(("kind", "degree"), ELEMENTS)
def test_patch(kind, degree, law, exchanged):
    """A state of constant stress in two blocks in any direction, with stick, oblique slip, or tied:
    exact.
    """
    dim = KINDS[kind]
    turn = turn_of_blocks(dim)
    mesh, both = blocks(kind, turn)
    young, poisson = 100.0, 0.3
    normal = turn @ np.eye(dim)[1] * -1.0  # of the upper body
    # Compression with shear across the contact, in the frame of the blocks.
    strain = np.zeros((dim, dim))
    strain[1, 1] = -0.01
    strain[0, 1] = strain[1, 0] = 0.001
    if dim == 3:
        strain[2, 1] = strain[1, 2] = -0.0007
    strain = turn @ strain @ turn.T
    stress = (
        young
        / (1 + poisson)
        * (strain + poisson / (1 - 2 * poisson) * np.trace(strain) * np.eye(dim))
    )
    traction = stress @ normal
    pressure = -traction @ normal
    shear = -(traction + pressure * normal)  # mu = - sigma_T of the upper body
    slip = 0.003 * shear / np.linalg.norm(shear) if law == "slip" else np.zeros(dim)

    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: young), poisson)
    outer = facets(mesh, lambda x: np.full(x.shape[1], True))
    outer = np.setdiff1d(outer, np.concatenate(both)).astype(np.int32)
    # At the edges of the contact nodes of both bodies coincide: their cells say which body they are
    # of.
    exact = fem.Function(space)
    exact.interpolate(lambda x: strain @ x[:dim])
    piece = np.zeros(len(space.tabulate_dof_coordinates()), dtype=bool)
    cells = space.dofmap.list
    middles = space.tabulate_dof_coordinates()[cells].mean(axis=1)[:, :dim]
    piece[cells[(middles @ turn)[:, 1] > 0]] = True
    exact.x.array.reshape(-1, dim)[piece] += slip
    outside = fem.locate_dofs_topological(space, dim - 1, outer)
    friction = {
        "bonded": None,
        "stick": Coulomb(0.9),
        "slip": Tresca(float(np.linalg.norm(shear))),
    }[law]
    sides = both[::-1] if exchanged else both
    problem = ContactProblem(
        a,
        no_load(mesh, v),
        [fem.dirichletbc(exact, outside)],
        contact=Pair(*sides, friction=friction, kind="bonded" if law == "bonded" else "unilateral"),
        algorithm="alm",
        tolerance=1e-12,
    )
    problem.solve()
    size = np.abs(exact.x.array).max()
    assert_allclose(problem.u.x.array, exact.x.array, rtol=0, atol=1e-9 * size)
    state = problem.state
    assert_allclose(state.pressure, pressure, rtol=1e-8)
    sign = -1.0 if exchanged else 1.0
    found = np.einsum("ijk,ik->ij", state.boundary.tangents, state.shear)
    assert_allclose(found, np.tile(sign * shear, (len(found), 1)), rtol=0, atol=1e-8 * pressure)
    assert problem.certificate.coupling < 1e-9


def example1(count, degree=1, stiffer=1.0, rigid=False, comm=MPI.COMM_SELF, **settings):
    """Example 1 of the paper without friction on a foundation of its own material, which may be
    stiffer.
    """
    bodies = [grid("quadrilateral", (count, count // 3), (0, 0), (3, 1))]
    if not rigid:
        bodies.append(grid("quadrilateral", (4 * count // 5, count // 4), (0, -1), (3, 0)))
    mesh = assembled("quadrilateral", *bodies, comm=comm)
    space, a, v = forms(
        mesh, degree, per_cell(mesh, lambda x: 5000.0 * (1.0 if x[1] > 0 else stiffer)), 0.4
    )
    ends = facets(mesh, lambda x: np.isclose(x[0], 0) | np.isclose(x[0], 3))
    bcs = [
        held(space, ends, 0),
        *(held(space, facets(mesh, at_coordinate(1, -1)), k) for k in (0, 1)),
    ]
    slave, master = (
        facets_of_piece(mesh, at_coordinate(1, 0), lambda x, s=s: s * x[1] > 0) for s in (1, -1)
    )
    x = ufl.SpatialCoordinate(mesh)
    load = ufl.as_vector((0.0, ufl.conditional(abs(x[0] - 1.5) < 0.5, -20.0, 0.0)))
    top = on(mesh, facets(mesh, at_coordinate(1, 1)))

    def gap(x):
        return 0.003 * (x[0] - 1.5) ** 2 + 0.001

    contact = (
        Foundation(slave, gap=gap) if rigid else Pair(slave, master, distance="nominal", gap=gap)
    )
    problem = ContactProblem(a, ufl.inner(load, v) * top, bcs, contact=contact, **settings)
    problem.solve()
    return problem


@pytest.mark.one_quick(("count", "degree"), [(60, 1), (30, 2)])
def test_example_1_on_a_foundation_of_its_own_material(count, degree):
    """Deflection, largest pressure and zone of contact are those of finer meshes of an independent
    program.
    """
    problem = example1(count, degree)
    x = problem.u.function_space.tabulate_dof_coordinates()
    middle = np.isclose(x[:, 0], 1.5) & np.isclose(x[:, 1], 1.0)
    assert problem.u.x.array.reshape(-1, 2)[middle, 1] == pytest.approx(-0.005332, rel=1e-3)
    state = problem.state
    assert state.pressure.max() == pytest.approx(16.268, rel=3e-3)
    pressed = state.boundary.x[state.pressure > 0, 0]
    assert (pressed.min(), pressed.max()) == pytest.approx((0.656, 2.344), abs=3.0 / count)
    assert state.forces[0][1] == pytest.approx(20.0, rel=1e-9)


def block_on_block(friction=None, push=0.0, lift=0.0, on_both=False, **settings):
    """A block that nothing holds but another one, which is held at the bottom; ``on_both``: which
    nothing holds.
    """
    mesh, both = blocks("quadrilateral", np.eye(2), ((6, 4), (4, 4)))
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 100.0))
    bottom = facets(mesh, at_coordinate(1, -1))
    bcs = [] if on_both else [held(space, bottom, k) for k in (0, 1)]
    load = per_cell(mesh, lambda x: 1.0 if x[1] > 0 else 0.0)
    force = load * ufl.inner(fem.Constant(mesh, (push, -1.0 + lift)), v) * ufl.dx
    return ContactProblem(a, force, bcs, contact=Pair(*both, friction=friction), **settings)


@pytest.mark.one_quick(
    "settings", [{}, {"linear_algebra": "condensed"}, {"algorithm": "alm"}, {"coulomb": "fp"}]
)
def test_a_block_held_by_another_one(settings):
    """Friction holds it: forces and moments of the contact are those of the load, by every
    algorithm.
    """
    problem = block_on_block(Coulomb(0.5), push=0.3, **settings)
    problem.solve()
    contact, friction = problem.state.forces
    assert contact + friction == pytest.approx([-0.3, 1.0], abs=1e-9)
    state = problem.state
    forces = -state.boundary.nodal_forces(state.pressure, state.shear)
    x = state.boundary.centre
    assert np.sum(x[:, 0] * forces[:, 1] - x[:, 1] * forces[:, 0]) == pytest.approx(
        0.5 + 0.3 * 0.5, rel=1e-9
    )


@pytest.mark.one_quick(
    ("arguments", "status"),
    [
        ({"push": 0.6, "friction": Coulomb(0.5)}, Status.SLIDES),
        ({"lift": 1.5, "friction": Coulomb(0.5)}, Status.OPEN),
        ({"push": 1.2, "friction": Coulomb(2.0)}, Status.TIPS),
        ({"on_both": True, "friction": Coulomb(0.5)}, Status.NOT_HELD),
        ({"push": 0.1}, Status.NOT_HELD),
    ],
)
def test_bodies_that_nothing_holds(arguments, status):
    """It is proved before anything is solved."""
    problem = block_on_block(**arguments)
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is status
    assert problem.history.linear_solves == 0


def test_what_is_refused():
    """Each in one sentence that names the argument."""
    mesh, (slave, master) = blocks("triangle", np.eye(2))
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 1.0))
    bcs = [held(space, facets(mesh, lambda x: np.isclose(abs(x[1]), 1)), k) for k in (0, 1)]

    def refused(pair, match, **settings):
        with pytest.raises(FormError, match=match):
            ContactProblem(a, no_load(mesh, v), bcs, contact=pair, **settings).solve()

    refused(
        Pair(slave, slave), r"contact\[0\].against: is the side itself: a surface touches itself"
    )
    refused(Pair(slave, slave[:2]), r"contact\[0\].against: shares 2 facets")
    refused(
        Pair(slave, facets(mesh, at_coordinate(1, 1))),
        r"contact\[0\]: its facets lie up to 1 behind",
    )
    refused(Pair(slave, master, gap="nominal"), r"contact\[0\].gap: is text")
    for key, choices in {
        "distance": "'geometry' or 'nominal'",
        "sliding": "'finite' or 'small'",
        "kind": "'unilateral' or 'bilateral' or 'bonded'",
    }.items():
        wrong = Pair(slave, master, **{key: "glued"})
        refused(wrong, rf"contact\[0\].{key}: must be {choices}, not 'glued'")


@pytest.mark.parametrize(
    ("shift", "faces", "match"),
    [
        ((0.0, -0.6), (0.0, 0.0), r"lie up to 0.6 behind those of the other side, of a size of 1"),
        (
            (5.0, 0.0),
            (0.0, 0.0),
            r"both are nearest at \(5.167, 0\), 4.33 apart, .* enclose 180 degrees",
        ),
        (
            (0.0, 0.0),
            (1.0, 0.0),
            r"nearest at \(0.1667, 1\), 1 apart, where their normals enclose 0 degrees",
        ),
    ],
    ids=["inside", "beside", "backwards"],
)
def test_bodies_in_the_wrong_place(shift, faces, match):
    """The upper block moved into the lower one or far beside it, or upside down: named with place
    and size.
    """
    upper, lower = (
        grid("quadrilateral", (3, 3), low, np.add(low, 1.0)) for low in (shift, (0.0, -1.0))
    )
    mesh = assembled("quadrilateral", upper, lower)
    _, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 1.0))
    pair = Pair(
        *(
            facets_of_cells(mesh, at_coordinate(1, height), np.arange(first, first + 9))
            for height, first in ((shift[1] + faces[0], 0), (faces[1], 9))
        )
    )
    with pytest.raises(FormError, match=match):
        ContactProblem(a, no_load(mesh, v), contact=pair).solve()


def stack(kind, comm=MPI.COMM_SELF):
    """Three bodies on each other and on a foundation, that nothing else holds, with meshes of all
    sizes.
    """
    heights, counts = (0.0, 1.0, 1.6, 2.6), ((5, 3), (4, 2), (7, 3))
    mesh = assembled(
        kind,
        *(
            grid(kind, n, (0.0, a), (1.0, b))
            for a, b, n in zip(heights, heights[1:], counts, strict=False)
        ),
        comm=comm,
    )
    _, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 100.0))

    def at(height, above):
        return facets_of_piece(mesh, at_coordinate(1, height), lambda x: (x[1] > height) == above)

    contact = [Pair(at(h, True), at(h, False), friction=Coulomb(0.5)) for h in heights[1:3]]
    contact.append(Foundation(at(0.0, True), friction=Coulomb(0.5)))
    weight = ufl.inner(fem.Constant(mesh, (0.2, -1.0)), v) * ufl.dx
    problem = ContactProblem(a, weight, contact=contact)
    problem.solve()
    return problem


@pytest.mark.one_quick("kind", ["triangle", "quadrilateral"])
def test_three_bodies_on_a_foundation(kind):
    """Each contact carries what is above it."""
    state = stack(kind).state
    forces = -state.boundary.nodal_forces(state.pressure, state.shear)
    for number, carried in enumerate((1.6, 1.0, 2.6)):
        total = forces[state.boundary.part == number].sum(axis=0)
        assert total == pytest.approx([-0.2 * carried, carried], abs=1e-8)


@pytest.mark.one_quick("linear_algebra", ["condensed", "krylov"])
def test_two_blocks_on_the_same_side_of_a_plate(linear_algebra):
    """Masters may share facets: the answer is that of the same plate whose side is given to each
    block in parts, and each contact carries what is above it.
    """
    kind = "triangle"
    bodies = [grid(kind, (9, 2), (0.0, -0.5), (3.0, 0.0))]
    bodies += [grid(kind, (4, 3), (left, 0.0), (left + 1.0, 1.0)) for left in (0.2, 1.7)]
    mesh = assembled(kind, *bodies)
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 100.0))
    plate = facets_of_piece(mesh, at_coordinate(1, 0), lambda x: x[1] < 0)
    parts = [
        facets_of_piece(
            mesh,
            lambda x, s=s: np.isclose(x[1], 0) & (s * (x[0] - 1.5) >= -1e-9),
            lambda x: x[1] < 0,
        )
        for s in (-1, 1)
    ]
    slaves = [
        facets_of_piece(
            mesh, at_coordinate(1, 0), lambda x, s=s: (x[1] > 0) & (s * (x[0] - 1.5) > 0)
        )
        for s in (-1, 1)
    ]
    bcs = [held(space, facets(mesh, at_coordinate(1, -0.5)), k) for k in (0, 1)]
    load = ufl.inner(fem.Constant(mesh, (0.2, -1.0)), v) * ufl.dx
    found = []
    for masters in ((plate, plate), parts):
        contact = [
            Pair(s, m, distance="nominal", gap=0.0, friction=Coulomb(0.5))
            for s, m in zip(slaves, masters, strict=True)
        ]
        problem = ContactProblem(a, load, bcs, contact=contact, linear_algebra=linear_algebra)
        problem.solve()
        found.append(problem.u.x.array.copy())
        state = problem.state
        forces = -state.boundary.nodal_forces(state.pressure, state.shear)
        for number in (0, 1):
            assert forces[state.boundary.part == number].sum(axis=0) == pytest.approx(
                [-0.2, 1.0], abs=1e-7
            )
    assert_allclose(*found, rtol=0, atol=1e-9 * np.abs(found[0]).max())
    with pytest.raises(FormError, match=r"contact\[1\].against: shares 4 facets"):
        ContactProblem(a, load, bcs, contact=[Pair(slaves[0], plate), Pair(slaves[1], slaves[0])])
    with pytest.raises(FormError, match=r"contact\[0\].against: shares 9 facets"):
        ContactProblem(a, load, bcs, contact=[Pair(slaves[0], plate), Pair(plate, slaves[1])])


@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["", "coulomb"])
@pytest.mark.parametrize(
    ("kind", "pressed"), [("quadrilateral", False), ("quadrilateral", True), ("hexahedron", False)]
)
def test_bodies_that_do_not_touch(kind, pressed, friction, linear_algebra):
    """A body is moved over another one without touching it: only rigidly, whether others are
    pressed beside it.
    """
    dim = KINDS[kind]
    up, ones = np.eye(dim)[1], np.ones(dim)
    small = (3,) * dim
    bodies = [
        grid(kind, small, -up, ones - up),
        grid(kind, (4,) * dim, 0.05 * up, ones + 0.05 * up),
    ]
    if pressed:
        bodies += [
            grid(kind, small, 2 * np.eye(dim)[0] + s * up, ones + 2 * np.eye(dim)[0] + s * up)
            for s in (-1, 0)
        ]
    mesh = assembled(kind, *bodies)
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: 100.0))
    contact = []
    for side, height in ((1, 0.05), (-1, 0.0))[: 1 + pressed]:
        sides = [
            facets_of_piece(
                mesh,
                lambda x, y=y, side=side: np.isclose(x[1], y) & (side * (1.5 - x[0]) > 0),
                lambda x, s=s: s * x[1] > 0,
            )
            for s, y in ((1, height), (-1, 0.0))
        ]
        contact.append(Pair(*sides, friction=friction))
    top, bottom = (facets(mesh, lambda x, s=s: s * x[1] > 0.99) for s in (1, -1))
    bcs = [held(space, bottom, k) for k in range(dim)]
    bcs += [held(space, top, k, value) for k, value in enumerate((0.01, -0.02, 0.005)[:dim])]
    problem = ContactProblem(
        a, no_load(mesh, v), bcs, contact=contact, linear_algebra=linear_algebra
    )
    problem.solve()
    state = problem.state
    first = state.boundary.part == 0
    assert not state.pressure[first].any()
    assert (state.pressure[~first] > 0).sum() == (~first).sum()
    assert problem.certificate.equilibrium < 1e-8
    here = (space.tabulate_dof_coordinates()[:, 0] < 1.5) & (
        space.tabulate_dof_coordinates()[:, 1] > 0.01
    )
    moved = problem.u.x.array.reshape(-1, dim)[here]
    assert_allclose(moved, np.tile((0.01, -0.02, 0.005)[:dim], (len(moved), 1)), atol=1e-12)


WORLD = MPI.COMM_WORLD

# Newton's method may leave a residual of 1e-8 of the forces, unless less is asked for.
KRYLOV = {"linear_algebra": "krylov", "petsc_options": {"snes_rtol": "1e-10"}}
PROBLEMS = {
    "plane": lambda comm: example1(24, comm=comm),
    "Q2": lambda comm: example1(12, 2, comm=comm),
    "stack": lambda comm: stack("triangle", comm),
    "hexahedra": lambda comm: paraboloids("hexahedron", 1, (4, 5), comm, linear_algebra="full"),
    "hexahedra, krylov": lambda comm: paraboloids("hexahedron", 1, (4, 5), comm, **KRYLOV),
    "tetrahedra, krylov": lambda comm: paraboloids("tetrahedron", 1, (4, 5), comm, **KRYLOV),
    "P2": lambda comm: paraboloids("tetrahedron", 2, (4, 5), comm, linear_algebra="full"),
    "P2, krylov": lambda comm: paraboloids("tetrahedron", 2, (4, 5), comm, **KRYLOV),
}


def points_of(state):
    """Part, position, weight, pressure and shear of the points of all ranks, sorted by place."""
    boundary = state.boundary
    shear = np.einsum("ijk,ik->ij", boundary.tangents, state.shear)
    columns = (boundary.part, boundary.x, boundary.weight, state.pressure, shear)
    rows = parallel.gather_rows(boundary.comm, np.column_stack(columns))
    return rows[np.lexsort(np.round(rows[:, : 1 + boundary.x.shape[1]], 9).T)]


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("name", PROBLEMS)
def test_one_rank_or_many(name):
    """Every kind of element and system; the certificate tries the map on all ranks."""
    together, alone = (PROBLEMS[name](comm) for comm in (WORLD, MPI.COMM_SELF))
    loose = name.endswith("krylov")  # directions of slip are those of the linear solver
    counts = [
        [(r.active_contact, r.slip_plus, r.slip_minus) for r in p.history.iterations]
        for p in (together, alone)
    ]
    assert loose or counts[0] == counts[1]
    ours, theirs = points_of(together.state), points_of(alone.state)
    assert ours.shape == theirs.shape
    size, close = np.abs(theirs).max(axis=0), 1e-9
    dimension = alone.state.boundary.x.shape[1]
    size[1 : 1 + dimension] = size[
        1 : 1 + dimension
    ].max()  # places: heights above y = 0 are round-off
    size[-1 - dimension :] = size[-1 - dimension]  # tractions
    assert (np.abs(ours - theirs) <= close * np.maximum(size, 1e-300)).all()
    assert_allclose(
        together.state.forces, alone.state.forces, atol=close * np.abs(alone.state.forces).max()
    )
    assert together.certificate.coupling < 1e-9
    assert together.certificate.holds


@pytest.mark.mpi(slow=True)
def test_ranks_without_cells(monkeypatch):
    """All cells are of the first rank; the others have nothing, and the certificate is the same."""
    plain = dmesh.create_cell_partitioner

    def all_to_the_first(*given):
        divide = plain(*given)

        def owners(*cells):
            count = divide(*cells).num_nodes
            links = adjacencylist(
                np.zeros(count, dtype=np.int32), np.arange(count + 1, dtype=np.int32)
            )
            return getattr(links, "_cpp_object", links)  # which is wrapped since dolfinx 0.10

        return owners

    monkeypatch.setattr(dmesh, "create_cell_partitioner", all_to_the_first)
    mesh = PROBLEMS["Q2"](WORLD).u.function_space.mesh
    assert WORLD.rank == 0 or mesh.topology.index_map(2).size_local == 0
    test_one_rank_or_many("Q2")
