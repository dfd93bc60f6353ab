"""Each exact value anew, from another formula or by integration; none may come from the number in
the file.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from ..elasticity import nodal_loads, prescribed
from ..expressions import ExpressionError
from ..grids import make_grid
from ..problem import problem_names, read_problem

NAMES = problem_names()
FAR = 1e-9  # off the surface, where a formula is 0 / 0 on it
CLOSE = {"cattaneo-loop": 2e-4}  # where slip ends the shear has a vertical slope
FURTHER = {"sphere": 1e-5, "two-spheres": 1e-5}  # where it would be lost in round-off


@cache
def rule(count):
    return np.polynomial.legendre.leggauss(count)


def gauss(low, high, function, singular=0.0, count=400):
    """An integral; points gather like a square at both ends, or around a point inside."""
    s, w = rule(count)
    total = 0.0
    ends = [low, singular, high] if low < singular < high else [low, high]
    for a, b in pairwise(ends):
        t = (1 + s) / 2
        x = a + (b - a) * np.sin(np.pi / 2 * t) ** 2
        total += np.sum(w / 2 * (b - a) * np.pi / 2 * np.sin(np.pi * t) * function(x))
    return total


# --- what the closed forms of the stress say ------------------------------------------------------

# Fields with their contact: from, to, both in the constants; the factor of an area is 2 pi x of
# revolutions.
FIELDS = {
    "smooth-edge": (0.0, 1.0),
    "smooth-edge-tresca": (-1.0, 1.0),
    "smooth-edge-coulomb": (-1.0, 1.0),
    "smooth-edge-space": (0.0, 1.0),
    "smooth-edge-tresca-space": (-1.0, 1.0),
    "hertz-line": (0.0, "a"),
    "wedge": (0.0, "a"),
    "flat-punch": (0.0, "a"),
    "cattaneo-incompressible": ("-a", "a"),
    "cattaneo-mindlin": ("-a", "a"),
    "cattaneo-loop": ("-a", "a"),
    "nafems-cylinder": ("-a", "a"),
    "sphere": (0.0, "a"),
    "two-spheres": (0.0, "a"),
    "cone": (0.0, "a"),
    "circular-punch": (0.0, "a"),
}


def stress(problem, component, x, y, time=None):
    """A component at points of the plane, in 3D at y = 0, at a time or the last one."""
    at = {"x": x, "y": y} if problem.dimension == 2 else {"x": x, "y": 0 * x, "z": y}
    if problem.dimension == 3:
        component = component.replace("y", "z")
    return problem.at(component, at, time)


def pressure_and_shear(problem, time=None):
    """Functions of x on the surface, at a time or the last one."""
    near = FURTHER.get(problem.name, FAR) * float(np.ptp(make_grid(problem).points[:, 0]))

    def at(component, x):
        return np.asarray(
            stress(problem, component, np.asarray(x, dtype=float), np.full(np.shape(x), near), time)
        )

    return lambda x: -at("s_yy", x), lambda x: -at("s_xy", x)


@pytest.mark.parametrize("name", FIELDS)
def test_forces_of_fields(name):
    """Forces, moments and pressures are integrals of the stress on the surface, whose formula the
    tractions have.
    """
    problem = read_problem(name)
    low, high = (problem.number(end) for end in FIELDS[name])
    depth = problem.numbers.get("depth", 1.0) if problem.dimension == 3 else 1.0

    def area(x):
        return depth * (2 * np.pi * x if problem.hypothesis == "axisymmetric" else 1.0)

    def value(quantity):
        pressure, shear = pressure_and_shear(problem, quantity.time)
        at = problem.number(quantity.point[0]) if quantity.point else 0.0

        def integral(function, power=0):
            return gauss(low, high, lambda x: x**power * function(x) * area(x))

        match quantity.measure:
            case "normal force":
                return integral(pressure)
            case "friction force":
                return integral(shear)
            case "pressure moment":
                return integral(pressure, 1)
            case "pressure mean square":
                return integral(pressure, 2) / integral(pressure)
            case "pressure at":
                return pressure(at)
            case "shear at":
                return shear(at)
            case "largest pressure":
                return pressure(np.linspace(low, high, 2001) + FAR).max()

    values = [(quantity, value(quantity)) for quantity in problem.quantities]
    known = [(quantity, found) for quantity, found in values if found is not None]
    for quantity, found in known:
        assert found == pytest.approx(quantity.numbers[0], rel=CLOSE.get(name, 5e-5)), quantity.name
    assert len(known) >= 2


@pytest.mark.parametrize("name", FIELDS)
def test_fields_are_in_equilibrium(name):
    """Also off the surface, and the surface beside the contact is free: central differences at
    random points.
    """
    problem = read_problem(name)
    grid, random = make_grid(problem), np.random.default_rng(4)
    size = np.ptp(grid.points[:, 0])
    x = (
        random.uniform(0.1, 0.9, 40)
        * size
        * random.choice([1, -1 if grid.points[:, 0].min() < 0 else 1], 40)
        / 2
    )
    y = random.uniform(0.15, 0.8, 40) * size / 2
    h = 1e-4 * size

    def slope(component, across):
        dx, dy = (h, 0.0) if across == "x" else (0.0, h)
        return (
            stress(problem, component, x + dx, y + dy) - stress(problem, component, x - dx, y - dy)
        ) / (2 * h)

    forces = [slope("s_xx", "x") + slope("s_xy", "y"), slope("s_xy", "x") + slope("s_yy", "y")]
    scale = np.abs(stress(problem, "s_yy", x, y)).max() / size
    if problem.hypothesis == "axisymmetric":
        # The hoop stress that equilibrium along the radius asks for must be continuous with s_xx on
        # the axis.
        forces = [forces[1] + stress(problem, "s_xy", x, y) / x]
        near = np.full(5, 1e-3 * size)
        level = np.linspace(0.2, 0.8, 5) * size
        hoop = stress(problem, "s_xx", near, level) + near * (
            (
                stress(problem, "s_xx", near * 1.01, level)
                - stress(problem, "s_xx", near * 0.99, level)
            )
            / (0.02 * near)
            + (stress(problem, "s_xy", near, level + h) - stress(problem, "s_xy", near, level - h))
            / (2 * h)
        )
        np.testing.assert_allclose(
            hoop, stress(problem, "s_xx", near, level), rtol=1e-2, atol=1e-3 * scale * size
        )
    for force in forces:
        assert np.abs(force).max() < 1e-4 * scale
    low, high = (problem.number(end) for end in FIELDS[name])
    beside = (
        np.array([high * 1.2, high * 2.0])
        if high < grid.points[:, 0].max()
        else np.array([-0.3, -0.7])
    )
    if low > grid.points[:, 0].min() or high < grid.points[:, 0].max():
        surface = pressure_and_shear(problem)
        assert all(
            np.abs(part(beside)).max() < 1e-5 * np.abs(surface[0](0.5 * high)) for part in surface
        )


def energy_of_edge(name):
    """Half of the work of tractions on the displacement of the closed form, by complex numbers,
    over the boundary.
    """
    problem = read_problem(name)
    young, nu = problem.numbers["young"], problem.numbers["poisson"]
    mu, kappa = young / (2 * (1 + nu)), 3 - 4 * nu
    size = problem.numbers["size"]

    def displacement(x, y):
        z = x + 1j * y
        if "tresca" in name:
            phi, slope = 1j * size * z**1.5, 1.5j * size * np.sqrt(z)
            psi = -1j * (kappa + 1.5) * size * z**1.5
            u = (kappa * phi - z * np.conj(slope) - np.conj(psi)) / (2 * mu)
            e = -20.0 / (2 * mu * nu / (1 - 2 * nu) + 2 * mu)
            return u.real + 5 * y / mu, u.imag + e * y
        function, integral = -size * np.sqrt(z), -2 * size / 3 * z**1.5
        along = (kappa - 1) / 2 * integral.real - y * function.imag
        return along / (2 * mu), ((kappa + 1) / 2 * integral.imag - y * function.real) / (2 * mu)

    def work(x, y, nx, ny):
        s = {c: np.asarray(stress(problem, c, x, y)) for c in ("s_xx", "s_yy", "s_xy")}
        u, v = displacement(x, y)
        return (s["s_xx"] * nx + s["s_xy"] * ny) * u + (s["s_xy"] * nx + s["s_yy"] * ny) * v

    total = gauss(-1, 1, lambda x: work(x, np.ones_like(x), 0, 1))
    total += gauss(0, 1, lambda y: work(np.ones_like(y), y, 1, 0))
    total += gauss(0, 1, lambda y: work(-np.ones_like(y), y, -1, 0))
    total += gauss(-1, 1, lambda x: work(x, np.full_like(x, 1e-12), 0, -1), singular=0.0)
    return total / 2


@pytest.mark.parametrize("name", ["smooth-edge", "smooth-edge-tresca", "smooth-edge-space"])
def test_energies_of_edges(name):
    problem = read_problem(name)
    depth = problem.numbers.get("depth", 1.0)
    energy = energy_of_edge(name.replace("-space", "")) * depth
    assert problem.quantity("strain energy").numbers[0] == pytest.approx(energy, rel=1e-6)


# --- others ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["wavy-quarter", "wavy-three-quarters", "wavy-two-bodies"])
def test_wavy_surfaces(name):
    """The pressure of Westergaard makes the surface follow the wave: the integral of its kernel is
    tried, too.
    """
    problem = read_problem(name)
    n = problem.numbers
    length, part = n["L"], n["part"]
    soft = sum((1 - b.poisson**2) / b.young for b in problem.bodies)
    a = length / np.pi * np.arcsin(np.sqrt(part))
    mean = part * np.pi * n["depth"] / (length * soft)

    def pressure(x):
        s = np.sin(np.pi * a / length)
        inside = np.clip(s**2 - np.sin(np.pi * x / length) ** 2, 0, None)
        return 2 * mean * np.cos(np.pi * x / length) / s**2 * np.sqrt(inside)

    total = gauss(0, a, pressure)
    found = {"force": total, "largest pressure": pressure(0.0)}
    found["mean square of x"] = gauss(0, a, lambda x: x**2 * pressure(x)) / total
    assert {q.name: q.numbers[0] for q in problem.quantities} == pytest.approx(found, rel=1e-7)
    # Displacements of a periodic half-plane: u(k) = 2 soft p(k) / k; inside, gap + u is constant.
    count = 4096
    x = np.arange(count) * length / count
    spectrum = np.fft.rfft(pressure(np.minimum(x, length - x)) * (np.minimum(x, length - x) < a))
    k = 2 * np.pi * np.arange(len(spectrum)) / length
    u = np.fft.irfft(np.concatenate([[0], 2 * soft * spectrum[1:] / k[1:]]), count)
    level = u + n["depth"] * (1 - np.cos(2 * np.pi * x / length))
    inside = np.minimum(x, length - x) < a
    assert np.ptp(level[inside]) < 1e-3 * n["depth"]
    assert level[~inside].min() > level[inside].max() - 1e-3 * n["depth"]


def test_rounded_punch():
    """The load of each half-width from the moment of the shape, and the pressure as a sum of flat
    punches.
    """
    problem = read_problem("rounded-punch")
    n = problem.numbers
    radius, b, a, modulus = n["R"], n["b"], n["a"], n["young"] / (1 - n["poisson"] ** 2)

    def load(
        c,
    ):  # P = E* int x g'(x) / sqrt(c^2 - x^2) dx over 0 < x < c, g' = (x - b) / R beyond b
        return modulus * gauss(
            b, c, lambda x: x * (x - b) / radius / np.sqrt(np.maximum(c * c - x * x, 1e-24))
        )

    h = 1e-4 * b

    def slope(c):
        return (load(c + h) - load(max(c - h, b))) / (c + h - max(c - h, b))

    c, w = np.polynomial.legendre.leggauss(60)
    at, share = b + (a - b) * (1 + c) / 2, w * (a - b) / 2
    slopes = np.array([slope(value) for value in at])
    found = {"force": load(a) / 2, "pressure at 0": (share * slopes / (np.pi * at)).sum()}
    found["mean square of x"] = (share * slopes * at**2 / 2).sum() / load(a)
    assert {q.name: q.numbers[0] for q in problem.quantities} == pytest.approx(found, rel=2e-4)


def bonded_layer(nu, a, count=24):
    """A parabola on a layer bonded to a rigid base, E* = h = R = 1: load, largest pressure and
    approach.

    The kernel is that of a half-plane, -log |x|, whose integrals of Chebyshev polynomials are
    known, and a smooth rest from the Fourier transform of the layer; the pressure vanishes at the
    ends like a square root.
    """
    s, share = rule(400)
    w, share = 15 * (1 + s), 15 * share  # frequencies: the rest decays like exp(-2 w)
    kappa, e = 3 - 4 * nu, np.exp(-2 * w)
    layer = (kappa * (1 - e * e) - 4 * w * e) / (
        kappa * (1 + e * e) + (1 + kappa**2 + 4 * w**2) * e
    )
    angle = np.arange(1, 201) * np.pi / 201
    t, weight = np.cos(angle), np.pi / 201 * np.sin(angle) ** 2
    at = (np.arange(count + 1) + 0.5) * np.pi / (2 * (count + 1))
    s, rows = np.cos(at), -np.ones((count + 1, count + 1))
    apart = np.multiply.outer(a * (s[:, None] - t), w)
    rest = ((np.exp(-w) - (1 - layer) * np.cos(apart)) / w) @ share
    for j, n in enumerate(range(0, 2 * count, 2)):
        known = (
            np.pi
            / 2
            * ((np.cos(n * at) / n if n else np.log(2 / a)) - np.cos((n + 2) * at) / (n + 2))
        )
        rows[:, j] = (
            2 / np.pi * a * (known + rest @ (weight * np.sin((n + 1) * angle) / np.sin(angle)))
        )
    *c, approach = np.linalg.solve(rows, -((a * s) ** 2) / 2)
    return a * np.pi / 2 * c[0], np.dot(c, (-1.0) ** np.arange(count)), approach


def test_layer_on_a_cylinder():
    """By an integral equation, which has Hertz's solution as its limit for a thick layer."""
    load, peak, approach = bonded_layer(0.3, 1.0)
    problem = read_problem("layer-cylinder")
    unit = problem.numbers["modulus"] / problem.numbers["R"]
    found = {"force": load * unit / 2, "largest pressure": peak * unit}
    assert {q.name: q.numbers[0] for q in problem.quantities} == pytest.approx(found, rel=1e-8)
    assert problem.numbers["approach"] * problem.numbers["R"] == pytest.approx(approach, rel=1e-8)
    load, peak, _ = bonded_layer(0.3, 0.02)
    assert load == pytest.approx(np.pi * 0.02**2 / 4, rel=1e-3)
    assert peak == pytest.approx(0.02 / 2, rel=1e-3)


def test_loads_are_balanced():
    """Where no support takes a force, that of the contact balances the tractions of the file."""
    every = 0
    for name in NAMES:
        problem = read_problem(name)
        if problem.dynamic:
            continue
        grid = make_grid(problem, 2 if problem.dimension == 2 else 0)
        d, contact = problem.dimension, problem.contacts[0]
        if any(body.turn for body in problem.bodies):
            continue  # test_a_wedge_on_its_slope
        at_points = {k for s in problem.supports for k in s.components if s.at}
        held = {k for _, k in prescribed(problem, grid)} - at_points
        below = set()
        if contact.against:
            below = {
                n
                for k, b in enumerate(grid.names)
                for n in grid.cells[grid.body == k].ravel()
                if b == "lower"
            }
            held -= {d - 1}
        for quantity in problem.quantities:
            if quantity.measure == "normal force" and contact.direction != ():
                axis = int(np.abs([problem.number(c) for c in contact.direction]).argmax())
            elif quantity.measure == "normal force" and problem.bodies[0].name == "upper":
                axis = d - 1
            elif quantity.measure == "friction force":
                axis = quantity.axis
            else:
                continue
            around = (
                problem.hypothesis == "axisymmetric" and axis == 0
            )  # the hoop stress has a share
            if axis not in held and not around and quantity.kind == "exact":
                loads = nodal_loads(problem, grid, quantity.time)
                loads[sorted(below)] = 0.0
                balance = quantity.numbers[0] + loads[:, axis].sum()
                assert balance == pytest.approx(0.0, abs=1e-5 * abs(quantity.numbers[0])), (
                    name,
                    quantity.name,
                )
                every += 1
    assert every >= 25


def test_a_wedge_on_its_slope():
    """Pressure and friction together carry the load."""
    problem = read_problem("nafems-sliding-wedge")
    angle = np.deg2rad(problem.bodies[0].turn)
    normal, along = (problem.quantity(name).numbers[0] for name in ("force", "friction"))
    up = normal * np.cos(angle) + along / np.cos(angle) * np.sin(angle)
    assert up == pytest.approx(-nodal_loads(problem, make_grid(problem))[:, 1].sum(), rel=1e-12)
    assert along == pytest.approx(-0.3 * normal * np.cos(angle), rel=1e-12)


def test_formulas_of_numbers():
    """Where the formula in the file has constants alone, it gives the number; others are in words,
    and tested above.
    """
    checked, words = [], []
    for name in NAMES:
        problem = read_problem(name)
        for quantity in problem.quantities:
            if quantity.kind != "exact":
                continue
            try:
                value = problem.number(quantity.formula)
            except ExpressionError:
                words.append((name, quantity.name))
                continue
            assert value == pytest.approx(quantity.numbers[0], rel=1e-7), (name, quantity.name)
            checked.append(name)
    assert len(checked) > 60
    assert sorted(set(words)) == IN_WORDS


# Integrals; the tests above compute each anew.
IN_WORDS = [
    ("rounded-punch", "mean square of x"),
    ("rounded-punch", "pressure at 0"),
    ("smooth-edge", "strain energy"),
    ("smooth-edge-space", "strain energy"),
    ("smooth-edge-tresca", "strain energy"),
    ("wavy-quarter", "mean square of x"),
    ("wavy-three-quarters", "mean square of x"),
    ("wavy-two-bodies", "mean square of x"),
]
