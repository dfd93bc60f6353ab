"""What must not change the result: units, mirror, translation, rotation, and the name of a law that
does nothing.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import PATCH, alone, energy, example1, on_mesh, rectangle, table_of

from signorini_fx.mechanics.effects.loads import Traction
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

LAWS = [{"bound": 1.5}, {"coefficient": 0.3}, {}]


def counts(solution):
    """Linear solves of each regularised problem, and the sets of each solve."""
    sets = [
        (r.active_contact, r.slip_plus, r.slip_minus, r.changed)
        for r in solution.history.iterations
    ]
    return [record.linear_solves for record in solution.history.outer], sets


def close(ours, theirs, rtol=1e-9):
    """Equal to 1e-9 of the largest value."""
    assert_allclose(ours, theirs, rtol=0, atol=rtol * np.abs(theirs).max())


@pytest.mark.one_quick("law", LAWS)
@pytest.mark.parametrize(("length", "stress"), [(1e3, 1e-6), (0.37, 7.3e4), (2.0**20, 2.0**-30)])
def test_units(law, length, stress):
    """m and Pa, mm and MPa, or anything: with gamma = auto the same counts and scaled results."""
    here = alone(example1(**law, gamma="auto", nx=60, ny=20))
    there = alone(
        example1(**law, gamma="auto", nx=60, ny=20, length_unit=length, stress_unit=stress)
    )
    assert counts(there) == counts(here)
    ours, theirs = table_of(there).columns, table_of(here).columns
    for name, unit in {
        "x": length,
        "gap": length,
        "u_n": length,
        "u_t": length,
        "pressure": stress,
        "shear": stress,
    }.items():
        close(ours[name] / unit, theirs[name])
    energies = [energy(solution) for solution in (there, here)]
    assert energies[0] == pytest.approx(energies[1] * stress * length**2, rel=1e-9)


@pytest.mark.parametrize("stress", [1e-12, 1.0, 1e9])
@pytest.mark.parametrize(
    ("push", "status"), [(0.9, Status.CONVERGED), (1.1, Status.SLIDES)], ids=["held", "pushed away"]
)
def test_statics_have_no_unit(push, status, stress):
    """A block that friction with F g = 1.5 on a length of 3 holds against a push of 4.5, in any
    unit of stress.
    """
    scene = example1(bound=1.5, nx=12, ny=4, gamma="auto", stress_unit=stress)
    aside = Traction(boundary="top", x=1.5 * push * stress)
    free = scene.model_copy(update={"displacement": (), "traction": (*scene.traction, aside)})
    assert alone(free, check=False).status is status


def skew(law, *, mirrored=False, cell="quadrilateral"):
    """A scene without symmetry, or its mirror image at x[0] = 1.5."""
    sign, x = (-1, "(3 - x[0])") if mirrored else (1, "x[0]")
    diagonal = {"diagonal": "left" if mirrored else "right"}
    return parse_scene(
        {
            "mesh": rectangle_mesh(**({"nx": 45, "ny": 15, "cell": cell} | diagonal)),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": fixed("left" if mirrored else "right"),
            "traction": {
                "boundary": "top",
                "x": f"{sign} * 4 * {x}",
                "y": f"-20 if {x} < 1 else -1",
            },
            "contact": {
                "boundary": "bottom",
                "gap": f"0.003 * ({x} - 1.1)**2 - 0.0005 * {x}",
                "friction": law,
            },
            "solver": {"gamma_n": 1e7, "gamma_t": 1e6},
        }
    )


@pytest.mark.one_quick("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize(
    "law",
    [{"law": "none"}, tresca_friction(1.5), coulomb_friction(0.4)],
    ids=lambda law: law["law"],
)
def test_mirror(law, cell):
    """The mirror image of the scene has the mirror image of the solution."""
    one, two = alone(skew(law, cell=cell)), alone(skew(law, mirrored=True, cell=cell))
    assert [a.linear_solves for a in one.history.outer] == [
        b.linear_solves for b in two.history.outer
    ]
    here, there = table_of(one).columns, table_of(two).columns
    close(there["x"][::-1], 3 - here["x"])
    for name, sign in {"pressure": 1, "u_n": 1, "gap": 1, "shear": -1, "u_t": -1}.items():
        close(there[name][::-1], sign * here[name])
    exchanged = {"open": "open", "stick": "stick", "slip+": "slip-", "slip-": "slip+"}
    if law["law"] != "none":
        assert [exchanged[state] for state in there["state"][::-1]] == here["state"].tolist()


def pressed(law, element, turn, shift):
    """A block whose top is moved down and sideways in full, with everything turned and shifted; and
    the turn.
    """
    c, s = np.cos(turn), np.sin(turn)
    rotation, shift = np.array([[c, -s], [s, c]]), np.array(shift)
    cell, degree = element
    tagged = rectangle(nx=30, ny=10, cell=cell)
    x = tagged.mesh.geometry.x
    x[:, :2] = x[:, :2] @ rotation.T + shift

    def first(x):
        """The coordinate along the foundation."""
        return rotation[0, 0] * (x[0] - shift[0]) + rotation[1, 0] * (x[1] - shift[1])

    top, side = rotation @ [0.0006, -0.002], rotation @ [0.5, 0.1]
    scene = {
        "mesh": tagged,
        "element": {"degree": degree},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {
            "boundary": "top",
            "x": top[0],
            "y": lambda x: np.full(x.shape[1], top[1]),
        },
        "traction": {"boundary": "right", "x": side[0], "y": side[1]},
        "contact": {
            "boundary": "bottom",
            "gap": lambda x: 0.003 * (first(x) - 1.4) ** 2 + 0.0002,
            "friction": law,
        },
        "solver": {"gamma_n": 1e7, "gamma_t": 1e7},
    }
    return on_mesh(parse_scene(scene), tagged), rotation


@pytest.mark.one_quick("element", [("quadrilateral", 1), ("triangle", 2)], ids=["Q1", "P2"])
@pytest.mark.parametrize(
    "law", [tresca_friction(2.0), coulomb_friction(0.2)], ids=lambda law: law["law"]
)
@pytest.mark.parametrize(
    ("turn", "shift"), [(0.0, (12.0, -7.0)), (0.7, (0.0, 0.0)), (2.6, (-3.0, 1.0))]
)
def test_rigid_motion_of_the_scene(law, element, turn, shift):
    """Turned and shifted, the scene has the turned solution, with the same pressures and the same
    counts.
    """
    here, _ = pressed(law, element, 0.0, (0.0, 0.0))
    there, rotation = pressed(law, element, turn, shift)
    one, two = alone(here), alone(there)
    columns = table_of(one).columns
    assert {"open", "stick", "slip+"} <= {*columns["state"], *columns["friction"]}
    assert counts(two) == counts(one)
    displacement = one.displacement.x.array.reshape(-1, 2) @ rotation.T
    close(two.displacement.x.array.reshape(-1, 2), displacement)
    for name in ("pressure", "shear", "u_n", "u_t", "gap", "in_contact", "direction"):
        a, b = (np.asarray(getattr(s.contact, name), dtype=float) for s in (two, one))
        close(a, b, rtol=1e-8)


@pytest.mark.parametrize("nothing", [{"bound": 0.0}, {"coefficient": 0.0}])
def test_a_law_that_transmits_nothing_is_no_friction(nothing):
    """F = 0 and g = 0 take the path of frictionless contact: the same bits, the same solves."""
    without, zero = alone(example1(nx=60, ny=20)), alone(example1(**nothing, nx=60, ny=20))
    assert_array_equal(zero.displacement.x.array, without.displacement.x.array)
    assert_array_equal(zero.contact.pressure, without.contact.pressure)
    assert (zero.algorithm, counts(zero)) == (without.algorithm, counts(without))


def test_the_start_does_not_matter():
    """All contact nodes, the paper's patch, or a patch at the end: the same solution (it is
    unique).
    """
    starts = ["all", PATCH, "x[0] <= 0.5", "x[0] > 2"]
    results = [
        alone(example1(bound=1.5, nx=60, ny=20, patch=start)).displacement.x.array
        for start in starts
    ]
    for result in results[1:]:
        close(result, results[0])
