"""Thermal strain: free and prevented expansion, exact states, a bimetal, a ring that is heated
until it is loose.
"""

import numpy as np
import pytest
from mpi4py import MPI
from on_meshes import nodes, tensors
from revolved import section
from scenes import alone
from steel_blocks import ELEMENTS, PLANE, body

from signorini_fx import SceneError
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON, ALPHA = 5000.0, 0.3, 1e-3
STEEL = {"young": YOUNG, "poisson": POISSON, "expansion": ALPHA}


def scene(tagged, degree=1, material=None, element=None, **more):
    """A heated body."""
    element = {"degree": degree, **(element or {})}
    return parse_scene(
        {"mesh": tagged, "element": element, "material": {**STEEL, **(material or {})}, **more}
    )


def sides(cells, *, held=False):
    """Symmetry on the sides through the origin; with ``held`` on the opposite ones too."""
    axes = (
        {"left": "x", "bottom": "y"}
        if cells in PLANE
        else {"left": "x", "front": "y", "bottom": "z"}
    )
    opposite = {"left": "right", "bottom": "top", "front": "back"}
    names = list(axes.items())
    names += [(opposite[side], axis) for side, axis in axes.items() if held]
    return [{"boundary": side, axis: 0.0} for side, axis in names]


def extreme(function):
    """The largest magnitude of a field on this rank."""
    return np.abs(function.x.array).max(initial=0.0)


# --- exact states ---------------------------------------------------------------------------------

FREE = [(*one, "plane strain" if one[0] in PLANE else None, "full") for one in ELEMENTS]
FREE += [("triangle", 2, "plane stress", "full"), ("quadrilateral", 1, "plane stress", "full")]
FREE += [("quadrilateral", 1, "plane strain", "reduced"), ("hexahedra", 1, None, "reduced")]


@pytest.mark.mpi
@pytest.mark.one_quick(("cells", "degree", "hypothesis", "volumetric"), FREE)
def test_free_expansion(cells, degree, hypothesis, volumetric):
    """y = k alpha T x without stress; in plane strain k = 1 + nu, and E alpha T is pressed out of
    the plane.
    """
    heat = 50.0
    material = {} if hypothesis is None else {"hypothesis": hypothesis}
    given = scene(
        body(cells),
        degree,
        material,
        {"volumetric": volumetric},
        displacement=sides(cells),
        temperature=[{"change": 0.4 * heat}, {"change": "0.6 * 50 + 0 * x[0]"}],
    )
    solution = solve(given, COMM, check=False)
    x, y = nodes(solution)
    out = YOUNG * ALPHA * heat if hypothesis == "plane strain" else 0.0
    grown = ALPHA * heat * (1 + POISSON if out else 1)
    assert np.abs(y - grown * x[:, : y.shape[1]]).max(initial=0.0) <= 1e-12
    assert solution.certificate.holds
    assert solution.certificate.equilibrium < 1e-11
    for stress in (solution.stress, solution.stress.recovered):
        round_off = 1e-9 if stress is solution.stress else 1e-5
        for name in ("xx", "yy", "xy"):
            assert extreme(stress.component(name)) <= round_off * YOUNG * ALPHA * heat
        assert (
            np.abs(stress.component("zz").x.array + out).max(initial=0.0)
            <= round_off * YOUNG * ALPHA * heat
        )
    # Of the energy only that of the stress out of the plane is left, sigma_zz^2 / (2 E) times the
    # area 2.
    energy = solution.certificate.strain_energy
    assert energy == (pytest.approx(out**2 / YOUNG, rel=1e-9) if out else 0.0)
    assert (solution.stress.error is None) is not bool(out)
    assert (
        StressRecovery.of(solution.model).error(solution.displacement)
        < 1e-5 * np.sqrt(YOUNG) * grown
    )


@pytest.mark.parametrize(
    ("cells", "hypothesis", "expected"),
    [
        ("quadrilateral", "plane strain", 1 / (1 - 2 * POISSON)),
        ("triangle", "plane stress", 1 / (1 - POISSON)),
        ("tetrahedra", None, 1 / (1 - 2 * POISSON)),
    ],
)
def test_prevented_expansion(cells, hypothesis, expected):
    """A block held on all sides: sigma = -E alpha T / (1 - 2 nu), in plane stress / (1 - nu); in
    two steps.
    """
    given = scene(
        body(cells, MPI.COMM_SELF),
        2 if cells == "tetrahedra" else 1,
        {} if hypothesis is None else {"hypothesis": hypothesis},
        displacement=sides(cells, held=True),
        temperature={"change": 40.0, "factors": [0.5, 1.0]},
    )
    solution = alone(given, check=False)
    assert extreme(solution.displacement) <= 1e-13
    assert solution.stress.component("xx").x.array == pytest.approx(
        -YOUNG * ALPHA * 40 * expected, rel=1e-10
    )
    assert solution.stress.recovered.component("yy").x.array == pytest.approx(
        -YOUNG * ALPHA * 40 * expected, rel=1e-5
    )
    # The supports carry it: a force of the stress times the area 1, at rest in balance.
    assert solution.resultants.of("right").force[0] == pytest.approx(
        -YOUNG * ALPHA * 40 * expected, rel=1e-9
    )
    first, last = (step.certificate for step in solution.steps)
    assert first.holds
    assert last.strain_energy == pytest.approx(4 * first.strain_energy, rel=1e-12)
    directions = 2 if hypothesis == "plane stress" else 3
    stress = YOUNG * ALPHA * 40 * expected
    assert last.strain_energy == pytest.approx(stress * directions * ALPHA * 40 / 2 * 2, rel=1e-10)


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra", "axisymmetric"])
def test_thermal_gap(cells, linear_algebra):
    """A bar between a wall and a stop at the distance d: heated, it presses with E (alpha T - d /
    l).
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    heat, gap = 50.0, 0.03
    up, bottom, top = {
        "quadrilateral": ("x", "left", "right"),
        "hexahedra": ("x", "left", "right"),
    }.get(cells, ("y", "bottom", "top"))
    tagged = section() if cells == "axisymmetric" else body(cells)
    length = 1.0 if cells == "axisymmetric" else 2.0
    material = (
        {}
        if cells == "hexahedra"
        else {"hypothesis": "axisymmetric" if up == "y" else "plane stress"}
    )
    held = [{"boundary": bottom, up: 0.0}]
    if cells != "axisymmetric":
        held += [one for one in sides(cells) if one["boundary"] != "left"]
    given = scene(
        tagged,
        1,
        material,
        displacement=held,
        temperature={"change": f"{heat}*t"},
        contact={"boundary": top, "gap": gap * length},
        load_steps={"times": [0.25, 1.0]},
        solver={"linear_algebra": linear_algebra, "algorithm": "alm", "tolerance": 1e-12},
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    assert solution.linear_algebra.startswith(linear_algebra)
    cold, hot = solution.steps
    assert not cold.contact.pressure.any()  # alpha T / 4 is below d / l
    pressure = YOUNG * (ALPHA * heat - gap)
    assert hot.contact.pressure == pytest.approx(pressure, rel=1e-8)
    axial = solution.stress.component(up * 2).x.array
    assert axial == pytest.approx(-pressure, rel=1e-7)
    assert solution.stress.recovered.component(up * 2).x.array == pytest.approx(-pressure, rel=1e-5)
    assert hot.certificate.strain_energy == pytest.approx(
        pressure**2 / (2 * YOUNG) * (np.pi * 4 if cells == "axisymmetric" else 2.0), rel=1e-8
    )


@pytest.mark.parametrize("cells", ["quadrilateral", "triangle"])
def test_linear_temperature(cells):
    """A linear temperature without a heat source causes no stress in plane stress, only a parabolic
    displacement.

    With T = b y and alpha: u_x = alpha b x y, u_y = alpha b (y^2 - x^2) / 2 (Boley and Weiner,
    Theory of thermal stresses, section 3.9).
    """
    given = scene(
        body(cells, MPI.COMM_SELF),
        2,
        {"hypothesis": "plane stress"},
        displacement=[
            {"at": [0.0, 0.0], "x": 0.0, "y": 0.0},
            {"at": [2.0, 0.0], "y": -ALPHA * 30 * 2},
        ],
        temperature={"change": lambda x: 30 * x[1]},
    )
    solution = alone(given, check=False)
    x, y = nodes(solution)
    expected = ALPHA * 30 * np.column_stack((x[:, 0] * x[:, 1], (x[:, 1] ** 2 - x[:, 0] ** 2) / 2))
    assert np.abs(y - expected).max() <= 1e-12
    assert solution.certificate.holds
    assert extreme(solution.stress.tensor) <= 1e-9 * YOUNG * ALPHA * 30


def logarithmic(r, inside, outside, heat, alpha=ALPHA):
    """Stresses of a long thick cylinder with T = heat ln(b / r) / ln(b / a), ends held, see
    Timoshenko and Goodier, Theory of Elasticity, section 150; sigma_zz = nu (sigma_r + sigma_t) - E
    alpha T.
    """
    k = YOUNG * alpha * heat / (2 * (1 - POISSON) * np.log(outside / inside))
    share = inside**2 / (outside**2 - inside**2) * np.log(outside / inside)
    change = heat * np.log(outside / r) / np.log(outside / inside)
    radial = k * (-np.log(outside / r) - share * (1 - outside**2 / r**2))
    hoop = k * (1 - np.log(outside / r) - share * (1 + outside**2 / r**2))
    return radial, hoop, POISSON * (radial + hoop) - YOUNG * alpha * change


def test_thick_cylinder():
    """The stresses of a logarithmic temperature, in half of a section."""
    inside, outside, heat = 1.0, 2.0, 60.0
    given = scene(
        section(inside, outside, 0.25, counts=(16, 2), comm=MPI.COMM_SELF),
        2,
        {"hypothesis": "axisymmetric"},
        displacement=[{"boundary": "bottom", "y": 0.0}, {"boundary": "top", "y": 0.0}],
        temperature={"change": f"{heat} * log({outside} / x[0]) / log({outside / inside})"},
    )
    solution = alone(given, check=False)
    assert solution.certificate.holds
    r = solution.stress.tensor.function_space.tabulate_dof_coordinates()[:, 0]
    exact = logarithmic(r, inside, outside, heat)
    sigma, size = tensors(solution.stress.tensor), np.abs(exact[2]).max()
    for component, expected in zip(((0, 0), (2, 2), (1, 1)), exact, strict=True):
        assert (
            np.abs(sigma[:, *component] - expected).max() <= 4e-3 * size
        )  # of the second order in 1/16
    axial = solution.stress.recovered.component("yy")
    r = axial.function_space.tabulate_dof_coordinates()[:, 0]
    assert np.abs(axial.x.array - logarithmic(r, inside, outside, heat)[2]).max() <= 1e-2 * size
    assert 1e-5 < solution.stress.error < 1e-2


# --- values and what is said ----------------------------------------------------------------------


@pytest.mark.mpi
def test_values_from_a_file(tmp_path_factory):
    """A table of points is interpolated linearly; a path is relative to the scene."""
    folder = COMM.bcast(tmp_path_factory.mktemp("table") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        corners = [(x, y) for x in (0.0, 0.7, 2.0) for y in (0.0, 1.0)]
        rows = [f"{y},{x},{10 + 3 * x - 2 * y}" for x, y in corners]
        (folder / "table.csv").write_text(
            "y, x, change\n" + "\n".join(rows) + "\n", encoding="utf-8"
        )
    COMM.barrier()
    given = {"mesh": body(), "material": STEEL, "displacement": sides("quadrilateral")}
    read = parse_scene({**given, "temperature": {"file": "table.csv"}}, folder=folder)
    first = solve(read, COMM, check=False)
    second = solve(
        parse_scene({**given, "temperature": {"change": "10 + 3*x[0] - 2*x[1]"}}), COMM, check=False
    )
    assert first.certificate.holds
    assert first.displacement.x.array == pytest.approx(second.displacement.x.array, abs=1e-12)


@pytest.mark.parametrize(
    ("temperature", "material", "place", "words"),
    [
        ({}, {}, "temperature", "give either change or file"),
        ({"change": "x[3]"}, {}, "temperature.change", "not a coordinate"),
        ({"change": "log(x[0] - 1)"}, {}, "temperature[0].change", "at all nodes of the mesh"),
        (
            {"change": "log(1.5 - t)", "factors": [1.0, 1.0]},
            {},
            "temperature[0].change",
            "at all nodes of the mesh",
        ),
        ({"change": 1.0, "region": "rubber"}, {}, "temperature[0].region", "no region 'rubber'"),
        ({"change": 1.0, "boundary": "left"}, {}, "temperature.boundary", "unknown key"),
        ({"change": 1.0}, {"expansion": None}, "material", "has no expansion"),
        ({"change": 1.0}, {"expansion": "x[0]"}, "material.expansion", "number"),
        ({"change": 1.0}, {"alpha": 1.0}, "material.alpha", "is written expansion"),
        ({"file": "nowhere.csv"}, {}, "temperature.file", "cannot be read"),
        ({"file": "columns.csv"}, {}, "temperature.file", "it needs x, y"),
        ({"file": "words.csv"}, {}, "temperature.file", "not one number"),
        ({"file": "line.csv"}, {}, "temperature.file", "span no area"),
        ({"file": "small.csv"}, {}, "temperature.file", "has no points around"),
        (
            {"file": "twice.csv"},
            {},
            "temperature.file",
            "has several values at one place, 1 and 2 at (1, 0.5)",
        ),
        (
            {"file": "nodal.vtu"},
            {},
            "temperature.file",
            "is no .csv: write the nodes and their values to one",
        ),
    ],
)
def test_what_is_wrong(temperature, material, place, words, tmp_path):
    """One error each."""
    for name, text in {
        "columns": "a,b\n1,2",
        "words": "x,y,change\n1,2,hot",
        "line": "x,y,change\n0,0,1\n1,1,1\n2,2,1",
        "twice": "x,y,change\n0,0,1\n1,0.5,1\n2,0,1\n0,1,1\n2,1,1\n1,0.5,2",
        "small": "x,y,change\n0,0,1\n1,0,1\n0,1,1\n1,1,1",
    }.items():
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    own = {key: value for key, value in {**STEEL, **material}.items() if value is not None}
    given = {
        "mesh": body("quadrilateral", MPI.COMM_SELF),
        "material": own,
        "displacement": sides("quadrilateral"),
    }
    with pytest.raises(SceneError) as caught:
        alone(parse_scene({**given, "temperature": temperature}, folder=tmp_path))
    ((path, message),) = caught.value.problems
    assert path == place
    assert words in message
