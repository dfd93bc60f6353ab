"""Two bodies that end at a plane of symmetry: half a model is the whole one, with no shear across
the plane.
"""

import numpy as np
import pytest
from mpi4py import MPI
from on_meshes import no_load
from scene_tables import box_mesh, coulomb_friction, fixed
from scenes import prepared
from two_bodies import KINDS, assembled, facets, facets_of_cells, forms, grid, held, per_cell

from signorini_fx import ContactProblem, Coulomb, Pair, Tresca
from signorini_fx.machine import parallel
from signorini_fx.scenes.reading import parse_scene

EXACT = {"algorithm": "alm", "tolerance": 1e-10}


def doubled(cells, x, axis):
    """A body and its mirror image, with the nodes on the plane of both."""
    count, image = len(x), x * np.where(np.arange(x.shape[1]) == axis, -1.0, 1.0)
    number = np.where(np.isclose(x[:, axis], 0), np.arange(count), np.arange(count) + count)
    both, every = np.vstack((cells, number[cells])), np.vstack((x, image))
    used = np.unique(both)
    return np.searchsorted(used, both), every[used]


def pressed(
    kind,
    degree,
    counts,
    *,
    half,
    slope=0.0,
    comm=MPI.COMM_SELF,
    side=0.0,
    of_master=None,
    beyond=-9.0,
    **given,
):
    """A block pressed into another one and pushed along the plane of symmetry, which is across the
    last but one axis.

    Args:
        kind: of the cells.
        degree: of the elements.
        counts: cells of the slave and of the master along a unit of length.
        half: whether the half beyond the plane is left out.
        slope: of the surface of the slave at 1/2; that of the master has half of it.
        comm: the ranks.
        side: displacement across the plane that the slave's support there prescribes.
        of_master: the same for the master; None: it is not held there.
        beyond: where along x the support of the master there begins.
        given: friction, bonded, and settings.
    """
    dim = KINDS[kind]
    axis, up = dim - 2, dim - 1
    low = np.array([0.0 if k == axis else -1.0 for k in range(up)])

    def body(count, sign, curved, wide):
        def place(x):
            along = curved * (x[:, :up] ** 2).sum(axis=1)
            return np.column_stack((x[:, :up], x[:, up] + along * (1 - np.abs(x[:, up]))))

        cells = (*(count * (1 if k == axis else 2) for k in range(up)), max(2, count // 2))
        made = grid(
            kind, cells, (*wide * low, min(sign, 0.0)), (*[wide] * up, max(sign, 0.0)), place
        )
        return made if half else doubled(*made, axis)

    bodies = body(counts[0], 1.0, slope, 1.0), body(counts[1], -1.0, slope / 2, 1.3)
    mesh = assembled(kind, *bodies, comm=comm)
    numbers = np.split(np.arange(sum(len(cells) for cells, _ in bodies)), [len(bodies[0][0])])
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: 100.0))
    sides = [
        facets_of_cells(mesh, lambda x, s=s: np.isclose(x[up], s * (x[:up] ** 2).sum(axis=0)), own)
        for s, own in zip((slope, slope / 2), numbers, strict=True)
    ]
    top, bottom = (facets(mesh, lambda x, z=z: np.isclose(x[up], z)) for z in (1.0, -1.0))
    bcs = [held(space, bottom, k) for k in range(dim)] + [held(space, top, up, -0.03)]
    if half:
        on_plane = [
            facets_of_cells(mesh, lambda x, low=low: np.isclose(x[axis], 0) & (x[0] >= low), own)
            for own, low in zip(numbers, (-9.0, beyond), strict=True)
        ]
        for plane, value in zip(on_plane, (side, of_master), strict=True):
            if value is not None:
                bcs.append(held(space, plane, axis, value))
    bcs += [held(space, top, k, 0.01 if k != axis else side) for k in range(up)]
    friction, bonded = given.pop("friction", None), given.pop("bonded", False)
    nothing = no_load(mesh, v)
    pair = Pair(*sides, kind="bonded") if bonded else Pair(*sides, friction=friction)
    problem = ContactProblem(a, nothing, bcs, contact=pair, **EXACT | given)
    problem.solve()
    return problem


def tractions(problem):
    """Places, pressures and shears as vectors, of all ranks."""
    state = problem.state
    shear = np.einsum("nij,nj->ni", state.boundary.tangents, state.shear)
    rows = parallel.gather_rows(
        state.boundary.comm, np.column_stack((state.boundary.x, state.pressure, shear))
    )
    dim = shear.shape[1]
    return rows[:, :dim], rows[:, dim], rows[:, dim + 1 :]


def differences(half, whole):
    """Of pressures and shears at the same places, relative to the largest pressure."""
    (x, pressure, shear), (places, *both) = tractions(half), tractions(whole)
    away = np.linalg.norm(x[:, None] - places, axis=2)
    assert away.min(axis=1).max() < 1e-9
    others = [values[away.argmin(axis=1)] for values in both]
    size = others[0].max()
    return np.abs(pressure - others[0]).max() / size, np.abs(shear - others[1]).max() / size


@pytest.mark.mpi
@pytest.mark.one_quick(
    ("kind", "degree", "counts", "given"),
    [
        ("quadrilateral", 1, (6, 5), {"friction": Coulomb(0.3), "linear_algebra": "full"}),
        ("triangle", 2, (5, 6), {"bonded": True}),
        ("hexahedron", 1, (3, 4), {"friction": Coulomb(0.3)}),
        ("tetrahedron", 2, (2, 3), {"friction": Coulomb(0.3), "linear_algebra": "full"}),
        ("tetrahedron", 1, (4, 3), {"friction": Tresca(0.3), "linear_algebra": "krylov"}),
        ("hexahedron", 1, (3, 2), {"bonded": True, "linear_algebra": "full"}),
    ],
)
def test_half_a_model(kind, degree, counts, given):
    """Flat sides: pressure and shear are those of the whole model, and none of the shear is across
    the plane.

    In 3D without the components that are left out, up to nine tenths of the friction bound were
    across it.
    """
    comm, axis = MPI.COMM_WORLD, KINDS[kind] - 2
    if comm.size > 1 and given.get("linear_algebra") is None:
        given = given | {"linear_algebra": "full"}
    half = pressed(kind, degree, counts, half=True, of_master=0.0, comm=comm, **given)
    whole = pressed(kind, degree, counts, half=False, comm=comm, **given)
    close = 1e-6 if given.get("linear_algebra") == "krylov" else 1e-8
    assert max(differences(half, whole)) < close
    x, _, shear = tractions(half)
    assert np.abs(shear[np.isclose(x[:, axis], 0), axis]).max() < 1e-12
    assert half.certificate.holds


@pytest.mark.one_quick(
    ("kind", "degree", "counts"), [("triangle", 1, (5, 6)), ("hexahedron", 1, (3, 4))]
)
def test_half_of_curved_sides(kind, degree, counts):
    """The normals on the plane are in it.  In 3D the sides are projected along facets, which do not
    know of it.
    """
    given = {"friction": Coulomb(0.3), "slope": 0.05}
    half = pressed(kind, degree, counts, half=True, of_master=0.0, **given)
    whole = pressed(kind, degree, counts, half=False, **given)
    pressure, shear = differences(half, whole)
    assert pressure < 5e-4
    assert shear < 5e-4
    assert half.certificate.holds


@pytest.mark.one_quick("of_master", [None, 0.0])
def test_where_it_is_no_plane_of_symmetry(of_master):
    """A support that holds the slave alone, or moves it past the other body, is none: friction acts
    across it.
    """
    side = 0.0 if of_master is None else 0.02
    problem = pressed(
        "hexahedron", 1, (3, 4), half=True, side=side, of_master=of_master, friction=Coulomb(0.3)
    )
    pair = problem.assembled.foundations.pairs[0]
    assert not pair.across.any()
    x, pressure, shear = tractions(problem)
    on_plane = np.isclose(x[:, 1], 0) & (pressure > 0)
    if side:  # it slides, against the direction in which it is moved
        assert (shear[on_plane, 1] > 0.1 * pressure[on_plane]).all()


def test_where_the_master_is_held_elsewhere():
    """Farther away than a facet is long it is no plane of symmetry of the slave."""
    problem = pressed(
        "hexahedron", 1, (3, 4), half=True, of_master=0.0, beyond=0.6, friction=Coulomb(0.3)
    )
    found = problem.assembled.foundations.pairs[0].across.any(axis=(1, 2))
    x = problem.state.boundary.x
    on_plane = np.isclose(x[:, 1], 0)
    assert found[on_plane & (x[:, 0] > 0.6)].all()
    assert not found[x[:, 0] < 0.1].any()


def two_boxes(support, **further):
    """A box upon another one, both of which end at y = 0, where supports hold them along the
    normal.
    """

    def body(name, count, height):
        size = {"length": 2.0, "nx": count, "ny": 2, "nz": 1, "cell": "hexahedron"}
        return {"name": name, "mesh": box_mesh(**size), "shift": [0.0, 0.0, height]}

    friction = coulomb_friction(0.3)
    return parse_scene(
        {
            "body": [body("lower", 5, 0.0), body("upper", 4, 1.0)],
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": [
                fixed("lower.bottom", "xyz"),
                *({"boundary": f"{name}.front", "normal": support} for name in ("lower", "upper")),
                {"boundary": "upper.top", "x": 0.01, "z": -0.03},
            ],
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "points": "boundary",
                "friction": friction,
            },
        }
        | further
    )


@pytest.mark.parametrize(
    ("support", "symmetric"), [(0.0, True), (0.001, False), ("0.001 * t", False)]
)
def test_supports_that_move(support, symmetric):
    """A support that moves, now or later, is no plane of symmetry."""
    scene = two_boxes(
        support, **({"load_steps": {"times": [0.0, 1.0]}} if isinstance(support, str) else {})
    )
    found = prepared(scene)
    assert found.pairs[0].across.any() == symmetric
