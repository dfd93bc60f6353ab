"""Heat: steady temperatures by closed forms, through contact, by friction, and what runs away."""

import subprocess
import sys

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, set_bc
from hertz import RADIUS, parabolic_block
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import function_of_cells
from petsc4py import PETSc
from scene_tables import box_mesh, coulomb_friction, fixed, plane_shape, rectangle_mesh
from scipy.special import beta

from signorini_fx import (
    Conductance,
    Contact,
    ContactProblem,
    Displacement,
    Heat,
    LinearElastic,
    Pair,
    Scene,
    sensitivity,
    solve,
)
from signorini_fx.addons.pictures.gather import gather_body
from signorini_fx.addons.pictures.results import gather_pictures
from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.records import Status
from signorini_fx.results.fields import fields_in_cells
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

BLOCK = {
    "mesh": rectangle_mesh(3, 3, length=1.0),
    "material": {"young": 1000.0, "poisson": 0.3, "expansion": 1e-4, "conductivity": 2.0},
    "displacement": fixed("left", "x"),
    "traction": {"boundary": "top", "y": -5.0},
    "contact": {"boundary": "bottom"},
    "heat": [
        {"boundary": "top", "temperature": 100.0},
        {"boundary": "bottom", "film": 6.0, "ambient": 20.0},
    ],
}
BOX = {
    "mesh": box_mesh(2, 2, 2, length=1.0, width=1.0),
    "displacement": [fixed("left", "x"), fixed("front", "y")],
    "traction": {"boundary": "top", "z": -5.0},
}
ROUND = {"material": {**BLOCK["material"], "hypothesis": "axisymmetric"}}
KINDS = {"plane": {}, "quadratic": {"element": {"degree": 2}}, "space": BOX, "revolution": ROUND}


def block(**more):
    return parse_scene({**BLOCK, **more})


def two(counts=(8, 12), expansion=0.0, **more):
    """A block of conductivity 15, 1 high, pressed by 2 on another one of 50, 2 high."""
    bodies = [
        {
            "name": name,
            "shift": [0.0, shift],
            "mesh": rectangle_mesh(nx, 2, length=1.0, height=height),
        }
        for name, nx, height, shift in (("up", counts[0], 1.0, 2.0), ("low", counts[1], 2.0, 0.0))
    ]
    given = {"poisson": 0.3, "expansion": expansion}
    scene = {
        "body": bodies,
        "material": [
            {"region": "up", "young": 1000.0, "conductivity": 15.0, **given},
            {"region": "low", "young": 2000.0, "conductivity": 50.0, **given},
        ],
        "displacement": [fixed("low.bottom", "y"), fixed("low.left", "x"), fixed("up.left", "x")],
        "traction": {"boundary": "up.top", "y": -2.0},
        "contact": {
            "boundary": "up.bottom",
            "against": "low.top",
            "conductance": {"closed": 20.0, "exponent": 0.95},
        },
        "heat": [
            {"boundary": "up.top", "temperature": 100.0},
            {"boundary": "low.bottom", "temperature": 0.0},
        ],
    }
    return parse_scene({**scene, **more})


@pytest.mark.mpi
@pytest.mark.parametrize("more", KINDS.values(), ids=KINDS)
def test_film(more):
    """A wall between a temperature and a film: 80 over 1 / k + 1 / film; where nothing else holds
    it, it expands without stress beside that of the pressure.
    """
    step = solve(block(**more)).steps[0]
    assert step.certificate.holds
    area = np.pi if more is ROUND else 1.0
    flux = 80.0 / (1 / 2.0 + 1 / 6.0) * area
    assert step.figures["heat_in"] == pytest.approx(flux, rel=1e-12)
    assert step.figures["heat_out"] == pytest.approx(flux, rel=1e-12)
    assert abs(step.figures["heat_balance"]) < 1e-12
    assert step.figures["heat_error"] < 1e-12


@pytest.mark.mpi
@pytest.mark.parametrize("more", KINDS.values(), ids=KINDS)
def test_source(more):
    """A source in a body between cold ends: its heat leaves, and its middle is s H^2 / 8 k warm."""
    up = "z" if more is BOX else "y"
    cold = [{"boundary": side, "temperature": 0.0} for side in ("top", "bottom")]
    changes = {**more, "heat": [*cold, {"source": 8.0}], "traction": {"boundary": "top", up: -5.0}}
    solution = solve(block(**changes))
    volume = np.pi if more is ROUND else 1.0
    assert solution.steps[0].figures["heat_out"] == pytest.approx(8.0 * volume, rel=1e-12)
    if "element" in more:
        assert solution.steps[0].figures["hottest"] == pytest.approx(0.5, rel=0.01)


def test_expands_freely():
    """Of a linear temperature a plane body bends without stress."""
    free = {
        "displacement": [
            {"at": [0.0, 0.0], "boundary": None, "x": 0.0, "y": 0.0},
            {"at": [1.0, 0.0], "boundary": None, "y": 0.0},
        ],
        "traction": [],
        "contact": [],
        "element": {"degree": 2},
        "material": {**BLOCK["material"], "hypothesis": "plane stress"},
    }
    free["displacement"] = [
        {key: value for key, value in entry.items() if value is not None}
        for entry in free["displacement"]
    ]
    solution = solve(block(**free))
    assert solution.certificate.holds
    assert solution.stress.von_mises.x.array.max() < 1e-9 * 1000.0 * 1e-4 * 100.0


@pytest.mark.mpi
@pytest.mark.parametrize("counts", [(8, 12), (16, 10)])
@pytest.mark.parametrize("degree", [1, 2])
def test_two_blocks(counts, degree):
    """100 over L_1 / k_1 + L_2 / k_2 + 1 / h, h = 20 p^.95, on facets that do not match."""
    solution = solve(two(counts, element={"degree": degree}))
    figures = solution.steps[0].figures
    assert solution.certificate.holds
    for name in ("heat_in", "heat_through", "heat_out"):
        assert figures[name] == pytest.approx(754.4420239523894, rel=2e-12)
    flux = np.abs(solution.state.fields["heat_flux"].values)
    assert_allclose(flux, 754.4420239523894, rtol=1e-9)


@pytest.mark.mpi
def test_by_forms():
    """The same by forms of a user's own for both fields; heat that one side loses the other one
    gains.
    """
    tagged = load_mesh(two(), MPI.COMM_WORLD)
    mesh = tagged.mesh
    V = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    Q = fem.functionspace(mesh, ("Lagrange", 1))
    young, conductivity = (function_of_cells(mesh) for _ in range(2))
    for region, modulus, k in (("up", 1000.0, 15.0), ("low", 2000.0, 50.0)):
        young.x.array[tagged.cells(region)] = modulus
        conductivity.x.array[tagged.cells(region)] = k

    def held(space, name, value, of=None):
        dofs = fem.locate_dofs_topological(space, 1, tagged.facets(name))
        return fem.dirichletbc(value, dofs, of)

    u, v, t, s = (
        ufl.TrialFunction(V),
        ufl.TestFunction(V),
        ufl.TrialFunction(Q),
        ufl.TestFunction(Q),
    )
    strain = ufl.sym(ufl.grad(u))
    stress = young / 1.3 * (strain + 0.75 * ufl.tr(strain) * ufl.Identity(2))
    across, up = V.sub(0), V.sub(1)
    pair = Pair(tagged.facets("up.bottom"), tagged.facets("low.top"))
    sides = ((across, "low.left"), (across, "up.left"), (up, "low.bottom"))
    bcs = [held(space, name, 0.0, space) for space, name in sides]
    top = ufl.conditional(ufl.gt(ufl.SpatialCoordinate(mesh)[1], 2.9), 2.0, 0.0)
    load = -top * ufl.FacetNormal(mesh)[1] * v[1] * ufl.ds
    problem = ContactProblem(ufl.inner(stress, ufl.grad(v)) * ufl.dx, load, bcs, pair)
    problem.solve()
    at_contact = problem.map(Q)
    h = 20.0 * problem.state.pressure**0.95
    conduction = conductivity * ufl.inner(ufl.grad(t), ufl.grad(s)) * ufl.dx
    matrix = assemble_matrix(fem.form(conduction))
    matrix.assemble()
    matrix.axpy(1.0, at_contact.matrix(h))
    temperature = fem.Function(Q)
    ends = [held(Q, "up.top", 100.0, Q), held(Q, "low.bottom", 0.0, Q)]
    dofs = np.concatenate([nodes[:owned] for nodes, owned in (each.dof_indices() for each in ends)])
    x = temperature.x.petsc_vec
    right = x.duplicate()
    right.set(0.0)
    set_bc(x, ends)
    rows = Q.dofmap.index_map.local_to_global(dofs).astype(PETSc.IntType)
    matrix.zeroRowsColumns(rows, 1.0, x, right)
    ksp = PETSc.KSP().create(mesh.comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.solve(right, x)
    flux = h * at_contact.of(temperature.x.array)
    assert_allclose(flux, 754.4420239523894, rtol=1e-9)
    passed, own = (at_contact.vector(flux, rows).sum() for rows in (None, at_contact.side))
    assert abs(mesh.comm.allreduce(passed)) < 1e-9
    assert mesh.comm.allreduce(own) == pytest.approx(754.4420239523894, rel=1e-9)
    with pytest.raises(FormError, match=r"space: must be \('Lagrange', 1\) on the mesh"):
        problem.map(V)


@pytest.mark.mpi
def test_expanding_blocks():
    """Where bodies bend by their temperature turns agree, and heat is in balance."""
    step = solve(two(expansion=1e-4)).steps[0]
    assert step.certificate.holds
    assert abs(step.figures["heat_balance"]) < 1e-12
    assert 2 < step.figures["heat_turns"] < 15


@pytest.mark.parametrize(
    ("conductance", "h"),
    [
        (20.0, 20.0),
        ({"table": [[0.0, 0.0], [1.0, 10.0], [3.0, 50.0]]}, 30.0),
        ([[0.0, 0.0], [1.0, 10.0], [3.0, 50.0]], 30.0),
        ({"open": 0.5, "length": 0.01}, 50.0),
    ],
)
def test_conductance(conductance, h):
    """Constant, by a table, and by the gap, here a closed one."""
    contact = {"boundary": "up.bottom", "against": "low.top", "conductance": conductance}
    solution = solve(two(contact=contact, solver={"algorithm": "alm"}))
    flux = 100.0 / (1 / 15 + 2 / 50 + 1 / h)
    assert solution.steps[0].figures["heat_through"] == pytest.approx(flux, rel=1e-9)


def test_open_gap():
    """Heat passes a gap of .2, whose filling conducts .5 over gap and roughness."""
    joint = {"open": 0.5, "length": 0.05}
    contact = {"boundary": "up.bottom", "against": "low.top", "gap": 0.2, "conductance": joint}
    held = [fixed("low.bottom"), fixed("up.top")]
    solution = solve(two(contact=contact, displacement=held, traction=[]))
    flux = 100.0 / (1 / 15 + 2 / 50 + 0.25 / 0.5)
    assert solution.steps[0].figures["heat_through"] == pytest.approx(flux, rel=1e-12)


@pytest.mark.parametrize(("exponent", "error"), [(1.0, 1e-10), (0.95, 2e-4), (0.5, 1.5e-3)])
def test_hertz(exponent, error):
    """Between isothermal sides what passes a Hertzian contact, and so the mean of p^m over it, is
    p_0^m a B(1/2, m/2 + 1) / 2 on half of it.
    """
    push = 0.02
    tagged = parabolic_block(96)
    floor = plane_shape([0.0, 0.0], [0.0, 1.0])
    joint = Conductance(1.0, exponent=exponent, temperature=0.0)
    solution = solve(
        Scene(
            mesh=tagged,
            material=LinearElastic(young=2e5, poisson=0.3, conductivity=1.0),
            displacement=[
                Displacement(boundary="middle", x=0.0),
                Displacement(boundary="top", y=-push),
            ],
            contact=Contact(boundary="low", foundation=floor, conductance=joint),
            heat=Heat(temperature=1.0),
        )
    )
    force = float(solution.contact.forces[0][-1])
    modulus = 2e5 / (1 - 0.3**2)
    a = np.sqrt(8 * force * RADIUS / np.pi / modulus)
    largest = 4 * force / np.pi / a
    expected = largest**exponent * a * beta(0.5, exponent / 2 + 1) / 2
    through = solution.steps[0].figures["heat_through"]
    assert through == pytest.approx(expected, rel=error)


def test_even_temperature():
    """Where no heat flows round-off is no imbalance."""
    solution = solve(block(heat={"boundary": "top", "temperature": 100.0}))
    assert abs(solution.steps[0].figures["heat_balance"]) < 1e-6


def test_fields_and_pictures():
    """They have the temperature: 100 at the top, and 20 + 120 / 6 at the film."""
    solution = solve(block())
    assert "temperature" in gather_pictures(solution).fields
    drawn = gather_body(solution, ["temperature"]).values["temperature"]
    for values in (fields_in_cells(solution)["temperature"].x.array, drawn):
        assert (values.min(), values.max()) == pytest.approx((40.0, 100.0))


def test_law():
    pressure, closed = np.array([0.0, 2.0, 4.0]), np.array([False, True, True])
    gap = np.array([0.1, 0.0, 0.0])
    of = Conductance(3.0, exponent=0.5, open=0.2, length=0.1).of(pressure, gap, closed)
    assert_allclose(of, [1.0, 3.0 * 2**0.5 + 2.0, 8.0])


# --- friction: E 1000, alpha 1e-3, F .2, K 2, L 1, p without heat 1 ---

CRITICAL = 2 * 2.0 / (1000.0 * 1e-3 * 0.2 * 1.0)


def rod(ratio, share=1.0, **more):
    """A rod without lateral contraction on a wall that slides at a part of the critical speed."""
    wall = {
        "shape": "plane",
        "point": [0.0, 0.0],
        "normal": [0.0, 1.0],
        "shift": [f"{ratio * CRITICAL}*t", 0.0],
    }
    scene = {
        "mesh": rectangle_mesh(1, 4, length=0.25),
        "material": {"young": 1e3, "poisson": 0.0, "expansion": 1e-3, "conductivity": 2.0},
        "displacement": [fixed("left", "x"), fixed("right", "x"), {"boundary": "top", "y": -1e-3}],
        "contact": {
            "boundary": "bottom",
            "foundation": wall,
            "friction": coulomb_friction(0.2),
            "friction_heat": {"share": share},
        },
        "heat": {"boundary": "top", "temperature": 0.0},
        "load_steps": {"times": [1.0]},
        "solver": {"algorithm": "alm"},
    }
    return parse_scene({**scene, **more})


@pytest.mark.mpi
@pytest.mark.parametrize(("ratio", "pressure"), [(0.5, 2.0), (0.9, 10.0)])
def test_sliding_wall(ratio, pressure):
    """p_0 / (1 - v / v_cr), v_cr = 2 K / (E alpha F L); heat F P v; turns repeat v / v_cr."""
    solution = solve(rod(ratio))
    figures = solution.steps[0].figures
    assert_allclose(solution.contact.pressure, pressure, rtol=1e-8)
    assert figures["heat_factor"] == pytest.approx(ratio, rel=1e-6)
    force = solution.contact.forces[0][-1]
    heat = 0.2 * force * ratio * CRITICAL
    assert figures["friction_heat"] == pytest.approx(heat, rel=1e-7)
    assert figures["friction_heat"] == pytest.approx(solution.contact.friction_work, rel=1e-13)
    assert figures["heat_out"] == pytest.approx(figures["friction_heat"], rel=1e-12)


@pytest.mark.parametrize("ratio", [1.1, 2.0])
def test_runs_away(ratio):
    """Beyond the critical speed there is no steady temperature."""
    with pytest.raises(ConvergenceError, match="heat runs away") as caught:
        solve(rod(ratio))
    assert caught.value.solution.status is Status.RUNS_AWAY
    assert f"multiplies a change by {ratio:g}" in str(caught.value)


def test_share():
    """What goes into the wall does not heat the rod: twice the critical speed."""
    solution = solve(rod(0.5, share=0.5))
    assert_allclose(solution.contact.pressure, 4 / 3, rtol=1e-8)


# --- what it does not go with ---


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"material": {"young": 1e3, "poisson": 0.3}}, "has no conductivity, which heat needs"),
        ({"material": {**BLOCK["material"], "conductivity": 0.0}}, "material.conductivity"),
        ({"heat": {"boundary": "top"}}, "heat: give one of temperature, flux, film, source"),
        ({"heat": {"boundary": "top", "film": 1.0}}, "heat: film and ambient go together"),
        ({"heat": {"flux": 1.0}}, "heat: flux and film need a boundary"),
        ({"heat": {"boundary": "top", "source": 1.0}}, "a boundary has no source"),
        ({"heat": {"boundary": "top", "film": -1.0, "ambient": 0.0}}, "heat.film"),
        (
            {"heat": {"boundary": "top", "temperature": 1.0, "factors": [1.0]}},
            "heat.factors: leave it out",
        ),
        ({"temperature": {"change": 1.0}}, "temperature: stays a change that is given"),
        ({"contact": {"boundary": "bottom", "conductance": -1.0}}, "contact.conductance: must not"),
        ({"contact": {"boundary": "bottom", "conductance": 1.0}}, "needs the temperature of the"),
        (
            {"contact": {"boundary": "bottom", "conductance": {"open": 1.0, "temperature": 0.0}}},
            "contact.conductance: open needs a length",
        ),
        (
            {"contact": {"boundary": "bottom", "friction_heat": {"share": 1.5}}},
            "contact.friction_heat.share: must be at most 1",
        ),
        (
            {"contact": {"boundary": "bottom", "friction_heat": 1.0}},
            "friction_heat: needs friction",
        ),
        (
            {"heat": [], "contact": {"boundary": "bottom", "conductance": {"temperature": 0.0}}},
            "contact.conductance: needs \\[\\[heat\\]\\]",
        ),
        (
            {"material": {**BLOCK["material"], "specific_heat": 3.0}},
            "needs specific_heat and density",
        ),
        (
            {"material": {**BLOCK["material"], "specific_heat": 3.0, "density": 2.0}},
            "material.specific_heat: needs load_steps.times, the first above 0",
        ),
        ({"initial_temperature": {"temperature": 1.0}}, "needs .* material.specific_heat"),
        ({"accuracy": {"target": 0.1}}, "accuracy: is not possible yet with heat"),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(SceneError, match=message):
        block(**changes)


@pytest.mark.mpi
def test_not_determined():
    contact = {"boundary": "up.bottom", "against": "low.top"}
    half = two(contact=contact, heat={"boundary": "up.top", "temperature": 1.0})
    with pytest.raises(SceneError, match="of body 'low' is not determined: give it one"):
        solve(half)
    with pytest.raises(SceneError, match=r"of piece 1 of 1 .* is not determined"):
        solve(block(heat={"boundary": "top", "flux": 1.0}))


def test_derivatives_are_refused():
    with pytest.raises(SceneError, match="not possible yet with heat"):
        sensitivity(block(), of="energy", by="traction[0].y")


def test_check_and_lines():
    assert "solved in turns" in str(check_scene(two()).findings)
    told = [str(finding.message) for finding in solve(two()).findings]
    assert any("754.4 in, 754.4 out, 754.4 through contact; balance" in line for line in told)


def test_short_steps():
    """Where a step is shorter than heat takes through a cell the next nodes get colder than at
    first, which check says: c h^2 / 6 k.
    """
    colder = []
    for time in (1e-4, 1.0):
        given = block(
            material={**BLOCK["material"], **STORES},
            heat={"boundary": "top", "temperature": 100.0},
            load_steps={"times": [time]},
        )
        said = [one.message for one in check_scene(given).findings if one.path == "heat"]
        coldest = solve(given).state.fields["temperature"].values.min()
        colder.append((coldest < -1e-9, any("colder than they began" in one for one in said)))
    assert colder == [(True, True), (False, False)]


def test_import_closure():
    """Without it nothing of it is imported."""
    code = (
        "import sys; from signorini_fx import solve; "
        "from signorini_fx.scenes.reading import parse_scene; "
        "solve(parse_scene({'mesh': {'generator': 'rectangle'}, "
        "'material': {'young': 1.0, 'poisson': 0.3}, 'contact': {'boundary': 'bottom'}, "
        "'displacement': {'boundary': 'left', 'x': 0.0}, "
        "'traction': {'boundary': 'top', 'y': -0.01}})); "
        "sys.exit(any(name.endswith('.heat') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- heat takes time: density 2, specific heat 3 ---

SIDES = ("temperature_slave", "temperature_master")
STORES = {"conductivity": 2.0, "density": 2.0, "specific_heat": 3.0}


@pytest.mark.parametrize(("degree", "error"), [(1, 2e-4), (2, 1e-6)])
def test_heated_end(degree, error):
    """From 0 to 100 at one end, the other one insulated: Fourier's series, each term of which falls
    by 1 / (1 + rate dt) in a step; without steps it falls by an exponential.
    """
    times = np.linspace(0.0, 0.5, 41)[1:]
    scene = {
        "mesh": rectangle_mesh(1, 40, length=0.1, height=1.0),
        "material": {"young": 1000.0, "poisson": 0.3, **STORES},
        "element": {"degree": degree},
        "displacement": fixed("bottom"),
        "load_steps": {"times": list(times)},
        "heat": {"boundary": "top", "temperature": 100.0},
    }
    solution = solve(parse_scene(scene))
    space = fem.functionspace(solution.model.tagged.mesh, ("Lagrange", degree))
    y = node_positions(space)[:, 1]
    odd = np.arange(1, 2000, 2) * np.pi / 2
    steps = (1 + odd**2 / 3 * times[0]) ** -40.0
    sign = np.where(np.arange(odd.size) % 2, -1.0, 1.0)
    found = solution.state.fields["temperature"].values.ravel() / 100
    for falls, within in ((steps, error), (np.exp(-(odd**2) * 0.5 / 3), 7e-3)):
        series = 1 - np.cos(y[:, None] * odd) @ (2 * sign / odd * falls)
        assert np.abs(found - series).max() < within
    brought, kept = (
        times[0] * sum(step.figures[name] for step in solution.steps)
        for name in ("heat_in", "heat_stored")
    )
    assert brought == pytest.approx(kept, rel=1e-10)
    assert kept == pytest.approx(60.0 * (1 - (2 / odd**2 * steps).sum()), rel=5 * error)


@pytest.mark.mpi
@pytest.mark.parametrize("more", KINDS.values(), ids=KINDS)
def test_lumped(more):
    """A body that conducts well and cools by a film: T - 20 falls by 1 / (1 + h A dt / c V)."""
    up = "z" if more is BOX else "y"
    times = [0.1, 0.2, 0.4, 1.0]
    changes = {
        **more,
        "material": {**more.get("material", BLOCK["material"]), **STORES, "conductivity": 1e7},
        "heat": [{"boundary": "bottom", "film": 6.0, "ambient": 20.0}],
        "initial_temperature": {"temperature": 120.0},
        "load_steps": {"times": times},
        "traction": {"boundary": "top", up: -5.0},
    }
    solution = solve(block(**changes))
    spans = np.diff(times, prepend=0.0)
    expected = 20.0 + 100.0 / np.cumprod(1 + 6.0 * spans / 6.0)
    found = [step.figures["hottest"] for step in solution.steps]
    assert_allclose(found, expected, rtol=1e-5)
    assert solution.certificate.holds


def test_contact_takes_time():
    """Of two blocks that conduct well, insulated but for their contact, the difference falls by
    1 / (1 + h dt (1 / C_1 + 1 / C_2)), and no heat is lost.
    """
    joint = {"boundary": "up.bottom", "against": "low.top", "conductance": 20.0}
    given = {"poisson": 0.3, "density": 2.0, "conductivity": 1e6}
    materials = [
        {"region": "up", "young": 1000.0, "specific_heat": 3.0, **given},
        {"region": "low", "young": 2000.0, "specific_heat": 5.0, **given},
    ]
    solution = solve(
        two(
            material=materials,
            contact=joint,
            heat={"source": 0.0},
            initial_temperature={"region": "up", "temperature": 100.0},
            load_steps={"times": [0.1, 0.3]},
        )
    )
    first, second = 2.0 * 3.0 * 1.0, 2.0 * 5.0 * 2.0
    fall = np.prod(1 / (1 + 20.0 * np.array([0.1, 0.2]) * (1 / first + 1 / second)))
    assert_allclose(
        np.ptp([solution.contact.columns[name] for name in SIDES], axis=0), 100.0 * fall, rtol=1e-4
    )
    mean = 100.0 * first / (first + second)
    hottest = mean + 100.0 * fall * second / (first + second)
    assert solution.steps[-1].figures["hottest"] == pytest.approx(hottest, rel=1e-4)
    assert abs(solution.steps[-1].figures["heat_stored"]) < 1e-6


def test_accuracy_in_time():
    """Steps are divided as an accuracy asks for; a state without temperature begins as time 0 does,
    here at 1.
    """
    changes = {
        "material": {**BLOCK["material"], **STORES, "conductivity": 1e7},
        "heat": {"boundary": "bottom", "film": 6.0, "ambient": 20.0},
        "initial_temperature": {"temperature": 120.0},
    }
    cooled = 20.0 + 100.0 * np.exp(-1.0)
    divided = block(**changes, load_steps={"times": [1.0], "time_accuracy": 0.03})
    assert solve(divided).steps[0].figures["hottest"] == pytest.approx(cooled, rel=0.03)
    cold = {key: value for key, value in BLOCK.items() if key != "heat"}
    cold |= {"traction": {"boundary": "top", "y": "-5*t"}, "load_steps": {"times": [1.0]}}
    later = block(**changes, load_steps={"times": [1.0, 2.0]})
    warm = solve(later, state=solve(parse_scene(cold)).state)
    assert warm.steps[0].figures["hottest"] == pytest.approx(70.0, rel=1e-5)


def test_friction_takes_time():
    """Beyond the critical speed the rod heats from step to step: each step has a temperature."""
    given = {"young": 1e3, "poisson": 0.0, "expansion": 1e-3, **STORES}
    solution = solve(rod(1.5, material=given, load_steps={"times": [0.02, 0.04]}))
    heat = [step.figures["friction_heat"] for step in solution.steps]
    assert heat[1] > heat[0]
    assert solution.steps[1].figures["heat_factor"] < 1.0
    assert abs(solution.steps[1].figures["heat_balance"]) < 1e-10
