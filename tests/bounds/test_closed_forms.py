"""Guaranteed bounds against closed forms: confined columns, a receding layer, a cylinder on a
layer.
"""

import numpy as np
import pytest
import ufl
from bounds_under_references import judged
from dolfinx import fem
from mpi4py import MPI
from on_meshes import function_of_cells
from scene_tables import fixed
from scenes import alone

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

# Of columns: the pressure P on top, and the weight a + b z per volume.
YOUNG, POISSON, PRESSED, HEAVY, HEAVIER = 1000.0, 0.3, 1.0, 2.0, 3.0
WALLS = [("left", 0, 0.0), ("right", 0, 1.0), ("front", 1, 0.0), ("back", 1, 1.0)]
# Half of a layer of height 1 under P / 2 on x < b; b: half width of the contact, p(0) / P, mean of
# x^2 under p.
RECEDING = {0.5: (1.007782, 0.789588, 0.1990711), 1.0: (1.402159, 0.523389, 0.4085977)}
# A parabola x^2 / (2 R) on a layer of height h that is bonded to its base, nu = 0.3: the half width
# over h,
# P R / (E* h^2) and p(0) R / (E* h).
ON_LAYER = {1.0: (1.221797, 0.804884), 2.0: (7.912153, 2.756023)}


def block(dimension, count, **more):
    """A mesh of triangles or tetrahedra of [0, 1] in each direction."""
    shape = {"length": 1.0, "height": 1.0, "nx": count, "ny": count, "cell": "triangle"}
    if dimension == 3:
        shape |= {"width": 1.0, "nz": count, "cell": "tetrahedron"}
    return {"generator": "rectangle" if dimension == 2 else "box", "parameters": shape | more}


def column(dimension, count, degree, bodies=1):
    """Blocks of height 1 between smooth walls under their weight: the stress along the last axis
    depends on it alone, and those across are nu / (1 - nu) times that.
    """
    up, names = "xyz"[dimension - 1], ["upper.", "lower."][:bodies] if bodies == 2 else [""]
    walls = [fixed(f"{name}{side}", "x") for name in names for side in ("left", "right")]
    if dimension == 3:
        walls += [fixed(f"{name}{side}", "y") for name in names for side in ("front", "back")]
    scene = {
        "element": {"degree": degree},
        "traction": {"boundary": f"{names[0]}top", up: -PRESSED},
        "body_force": {up: f"-{HEAVY} - {HEAVIER}*x[{dimension - 1}]"},
        "displacement": walls,
        "solver": {"algorithm": "alm"},
    }
    material = {"young": YOUNG, "poisson": POISSON}
    if bodies == 1:
        return parse_scene(
            {
                **scene,
                "mesh": block(dimension, count),
                "material": material,
                "contact": {"boundary": "bottom"},
            }
        )
    # Nodes of both do not meet.
    both = [
        {"name": "upper", "mesh": block(dimension, count), "shift": [*[0.0] * (dimension - 1), 1.0]}
    ]
    both.append({"name": "lower", "mesh": block(dimension, count + 1)})
    stiff = {"region": "lower", "young": 3 * YOUNG, "poisson": POISSON}
    return parse_scene(
        {
            **scene,
            "body": both,
            "material": [{**material, "region": "upper"}, stiff],
            "displacement": [*walls, {"boundary": "lower.bottom", up: 0.0}],
            "contact": {"boundary": "upper.bottom", "against": "lower.top"},
        }
    )


def true_error(solution, bodies):
    """Energy norms of the error of a column and of its solution, and the force of its contact."""
    mesh, d, y = solution.model.tagged.mesh, solution.model.dimension, solution.displacement
    height = ufl.SpatialCoordinate(mesh)[d - 1]
    modulus = function_of_cells(mesh)
    modulus.x.array[:] = YOUNG
    if bodies == 2:
        modulus.x.array[solution.model.tagged.cells("lower")] = 3 * YOUNG
    along = -PRESSED - HEAVY * (bodies - height) - HEAVIER * (bodies**2 - height**2) / 2
    share = POISSON / (1 - POISSON)
    exact = ufl.as_matrix(
        [[along * (1 if i == d - 1 else share) * (i == j) for j in range(d)] for i in range(d)]
    )
    lame, mu = modulus * POISSON / (1 + POISSON) / (1 - 2 * POISSON), modulus / 2 / (1 + POISSON)
    computed = lame * ufl.div(y) * ufl.Identity(d) + 2 * mu * ufl.sym(ufl.grad(y))

    def norm(stress):
        trace = (1 + POISSON) * ufl.tr(stress) if d == 2 else ufl.tr(stress)
        strain = (1 + POISSON) / modulus * stress - POISSON / modulus * trace * ufl.Identity(d)
        return float(np.sqrt(fem.assemble_scalar(fem.form(ufl.inner(stress, strain) * ufl.dx))))

    base = bodies - 1
    return (
        norm(computed - exact),
        norm(exact),
        PRESSED + HEAVY + HEAVIER * (bodies**2 - base**2) / 2,
    )


@pytest.mark.one_quick("degree", [1, 2])
@pytest.mark.parametrize(
    ("dimension", "count", "bodies"), [(2, 4, 1), (2, 4, 2), (3, 2, 1), (3, 2, 2)]
)
def test_a_column(dimension, count, bodies, degree):
    """The bound is above the true error and not far from it, and holds energy and force."""
    solution = alone(column(dimension, count, degree, bodies))
    bound, (true, size, force) = solution.error_bound, true_error(solution, bodies)
    assert true > 5e-4 * size
    # Tetrahedra of degree 2 have a stress of degree 1.
    assert true < bound.error < (1.8 if degree == 1 else 5.0 if dimension == 2 else 15.0) * true
    least, greatest = bound.strain_energy
    assert least < size**2 / 2 < greatest
    low, high = solution.force_bounds(
        solution.statement.contact[0].boundary, tuple(np.eye(dimension)[-1])
    )
    assert low - 1e-9 * force <= force <= high + 1e-9 * force


def receding(b, *, nx, ny, degree):
    """The layer, loaded by a pressure that jumps at a node."""
    return parse_scene(
        {
            "mesh": block(2, 1, length=6.0, nx=nx, ny=ny),
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": fixed("left", "x"),
            "traction": {"boundary": "top", "pressure": f"{0.5 / b} if x[0] <= {b} else 0"},
            "contact": {"boundary": "bottom"},
            "solver": {"algorithm": "alm"},
        }
    )


def moments(solution):
    """Of the contact pressure over x > 0: its force, the mean of x^2, its largest value."""
    c = solution.table.columns
    force = np.dot(c["weight"], c["pressure"])
    return force, np.dot(c["weight"], c["pressure"] * c["x"] ** 2) / force, c["pressure"].max()


@pytest.mark.slow
@pytest.mark.parametrize("b", RECEDING)
def test_a_receding_layer(b):
    """A zone that no load changes; the bound holds against a nested reference."""
    wide, peak, mean = RECEDING[b]
    fine = alone(receding(b, nx=96, ny=16, degree=2))
    force, found, largest = moments(fine)
    assert force == pytest.approx(0.5, rel=1e-6)
    assert found == pytest.approx(mean, rel=2e-3)
    assert largest == pytest.approx(peak, rel=5e-3)
    c = fine.table.columns
    assert c["x"][c["pressure"] > 0].max() == pytest.approx(wide, abs=6 / 192)
    for degree in (1, 2):
        found = judged(receding(b, nx=24, ny=4, degree=degree))
        assert not isinstance(found, str), found
        assert 1 < found[0] < 2
        assert not found[2]


def on_layer(deep, *, nx, ny, degree):
    """Half of a layer under a parabola that is so deep in it."""
    return parse_scene(
        {
            "mesh": block(2, 1, length=6.0, nx=nx, ny=ny),
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": [fixed("bottom"), fixed("left", "x")],
            "contact": {"boundary": "top", "gap": f"x[0]**2 / 200 - {deep}"},
            "solver": {"algorithm": "alm"},
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("wide", ON_LAYER)
def test_a_cylinder_on_a_layer(wide):
    """The force that belongs to the width, the pressure in the middle; the bounds hold against
    these.
    """
    force, peak = ON_LAYER[wide]
    unit = 100 / (1 - 0.3**2) / 100  # E* h / R

    def beyond(deep):
        return 2 * moments(alone(on_layer(deep, nx=72, ny=12, degree=2)))[0] / unit - force

    first, second = wide**2 / 300, wide**2 / 250
    values = beyond(first), beyond(second)
    for _ in range(4):
        third = second - values[1] * (second - first) / (values[1] - values[0])
        first, second, values = second, third, (values[1], beyond(third))
    fine = alone(on_layer(second, nx=72, ny=12, degree=2))
    assert values[1] == pytest.approx(0, abs=1e-4 * force)
    c = fine.table.columns
    assert c["pressure"].max() / unit == pytest.approx(peak, rel=5e-3)
    assert c["x"][c["pressure"] > 0].max() == pytest.approx(wide, abs=6 / 72)
    for degree in (1, 2):
        coarse = on_layer(second, nx=24, ny=4, degree=degree)
        found = judged(coarse)
        assert not isinstance(found, str), found
        assert 1 < found[0] < 2.5
        assert not found[2]
        low, high = alone(coarse).force_bounds("top", (0.0, -1.0))
        assert low <= force * unit / 2 <= high


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_jump_is_at_nodes(dimension):
    """A load that jumps at nodes is as good as one on parts of the boundary; one that jumps between
    them is refused.
    """
    scene = column(dimension, 4 if dimension == 2 else 2, 1)
    up = "xyz"[dimension - 1]
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    jumping = {"boundary": "top", up: "where(x[0] < 0.5, -2, -1)"}
    tagged = tag_boundaries(
        load_mesh(scene, MPI.COMM_SELF).mesh,
        {
            **{
                name: (lambda x, k=k, at=at: abs(x[k] - at) < 1e-9)
                for name, k, at in WALLS[: 2 * dimension - 2]
            },
            "bottom": lambda x: x[dimension - 1] < 1e-9,
            "first": lambda x: (x[dimension - 1] > 1 - 1e-9) & (x[0] < 0.5 + 1e-9),
            "second": lambda x: (x[dimension - 1] > 1 - 1e-9) & (x[0] > 0.5 - 1e-9),
        },
    )
    parts = [{"boundary": "first", up: -2.0}, {"boundary": "second", up: -1.0}]
    ours = alone(parse_scene(fields | {"traction": jumping})).error_bound
    theirs = alone(parse_scene(fields | {"mesh": tagged, "traction": parts})).error_bound
    assert ours.error == pytest.approx(theirs.error, rel=1e-6)
    between = alone(
        parse_scene(fields | {"traction": {"boundary": "top", up: "where(x[0] < 0.4, -2, -1)"}})
    )
    assert "jumps or has a kink between nodes" in between.error_bound
