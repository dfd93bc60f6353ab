"""Results of a ``ContactProblem``: the same problem as a scene and as UFL has the same folder and
figures.
"""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import no_load, trial_and_test, vector_space
from scene_tables import box_mesh, coulomb_friction, fixed, rectangle_mesh
from scenes import example1
from two_bodies import stress_of

from signorini_fx import ContactProblem, Foundation, Pair, read_results, write_results
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.template import summary_schema

COMM = MPI.COMM_WORLD
# What a run says of itself, of which two runs have their own; and the errors of numbers, which are
# smaller where entries of a scene tell what holds a body.
OF_THE_RUN = {"cost", "finished", "timings", "scene", "findings", "versions", "fields", "numbers"}


def as_forms(statement, tagged, **arguments):
    """A scene with one material as forms on its mesh, and the Constant that multiplies its
    loads.
    """
    mesh, (material,), gdim = tagged.mesh, statement.material, tagged.dimension
    V = vector_space(mesh, statement.element.degree)
    (u, v), x = trial_and_test(V), ufl.SpatialCoordinate(mesh)

    def stress(y):
        sigma, lame = stress_of(y, material.young, material.poisson), 0.0
        if gdim == 3:
            return sigma
        lame = (
            material.young * material.poisson / (1 + material.poisson) / (1 - 2 * material.poisson)
        )
        return ufl.as_tensor(
            [
                [sigma[0, 0], sigma[0, 1], 0],
                [sigma[1, 0], sigma[1, 1], 0],
                [0, 0, lame * ufl.div(y)],
            ]
        )

    factor = fem.Constant(mesh, 1.0)
    a = ufl.inner(stress_of(u, material.young, material.poisson), ufl.sym(ufl.grad(v))) * ufl.dx
    L = no_load(mesh, v)
    for load in statement.effects["traction"]:
        ds = on(tagged, load.boundary)
        components = [
            ufl.conditional(ufl.And(ufl.ge(x[0], 1), ufl.le(x[0], 2)), -20.0, 0.0)
            if hasattr(value, "text")
            else value
            for value in load.components[:gdim]
        ]
        L += (
            factor
            * ufl.inner(ufl.as_vector(components), v)
            * ds(metadata={"quadrature_degree": 20})
        )
    bcs = []
    for effect in statement.displacement:
        for k, value in enumerate(effect.components[:gdim]):
            if value is not None:
                dofs = fem.locate_dofs_topological(
                    V.sub(k), gdim - 1, tagged.facets(effect.boundary)
                )
                bcs.append(fem.dirichletbc(float(value), dofs, V.sub(k)))
    names = {name: tagged.facets(name) for name in tagged.boundaries}
    contact = []
    for effect in statement.contact:
        laws = {"friction": effect.friction if effect.friction.acts else None}
        if effect.against is None:
            contact.append(Foundation(tagged.facets(effect.boundary), effect.gap, **laws))
        else:
            contact.append(
                Pair(tagged.facets(effect.boundary), tagged.facets(effect.against), **laws)
            )
    settings = statement.solver.model_dump(include={"gamma_n", "gamma_t", "error_bound", "coulomb"})
    arguments = {"stress": stress, "boundaries": names} | arguments
    return ContactProblem(a, L, bcs, contact, **arguments, **settings), factor


def on(tagged, name):
    """The measure of a boundary."""
    facets = tagged.facets(name)
    tags = dmesh.meshtags(
        tagged.mesh, tagged.dimension - 1, facets, np.full(facets.size, 1, dtype=np.int32)
    )
    return ufl.ds(domain=tagged.mesh, subdomain_data=tags)(1)


def block(**changes):
    """A block in 3D on a rough foundation."""
    data = {
        "mesh": box_mesh(3, 2, 2, cell="tetrahedron"),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.002, "y": 0.0, "z": -0.01},
        "traction": {"boundary": "right", "x": 2.0},
        "contact": {"boundary": "bottom", "gap": 0.002, "friction": coulomb_friction(0.3)},
        "solver": {"gamma_n": 1e7, "gamma_t": 1e7},
    }
    return parse_scene(data | changes)


def two_blocks():
    """A block on another one, which is held."""
    low = rectangle_mesh(5, 3, length=2.0, height=1.0)
    high = rectangle_mesh(3, 3, length=1.0, height=1.0)
    return parse_scene(
        {
            "body": [
                {"name": "low", "mesh": low},
                {"name": "high", "mesh": high, "shift": [0.5, 1.0]},
            ],
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [fixed("low.bottom"), {"boundary": "high.top", "x": 0.001, "y": -0.01}],
            "traction": {"boundary": "high.left", "x": 1.0},
            "contact": {
                "boundary": "high.bottom",
                "against": "low.top",
                "points": "boundary",
                "friction": coulomb_friction(0.3),
            },
            "solver": {"gamma_n": 1e7, "gamma_t": 1e7},
        }
    )


def numbers(value, path=""):
    """All numbers of a value with their paths but places, which may lie where two extremes are
    equal.
    """
    if isinstance(value, dict | list):
        entries = value.items() if isinstance(value, dict) else enumerate(value)
        return {k: v for key, entry in entries for k, v in numbers(entry, f"{path}/{key}").items()}
    is_number = (
        isinstance(value, int | float) and not isinstance(value, bool) and "/place" not in path
    )
    return {path: float(value)} if is_number else {}


def differences(scene, forms):
    """What two summaries differ in: keys of one alone, and figures that are further apart than
    round-off.

    A penetration is rounded relative to the displacement and multiplied by gamma_n = 1e4 moduli, so
    that two assemblies of one problem agree to a few 1e4 eps = 2e-12 of the forces, and to 1e-11 on
    any number of ranks.
    """
    apart = []
    for summary in (scene, forms):
        summary["resultants"] = {str(row["boundary"]): row for row in summary["resultants"]}
    for key in sorted((scene.keys() & forms.keys()) - OF_THE_RUN):
        ours, theirs = numbers(scene[key], key), numbers(forms[key], key)
        beside = (
            numbers(scene[key.replace("friction", "contact")])
            if key.startswith("friction_")
            else {}
        )
        size = (
            1.0
            if key == "certificate"
            else max(map(abs, [*ours.values(), *beside.values()]), default=1.0)
        )
        common = ours.keys() & theirs.keys()
        apart += [
            (k, ours[k], theirs[k])
            for k in common
            if not abs(ours[k] - theirs[k]) <= 1e-11 * max(size, 1e-300)
        ]
        apart += [(k, "not in both") for k in ours.keys() ^ theirs.keys()]
    return apart


def files_in(folder):
    return sorted(
        str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file()
    )


def shared_folder(tmp_path):
    """The same on all ranks."""
    return COMM.bcast(tmp_path)


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    "scene",
    [example1(coefficient=0.3, nx=12, ny=4, poisson=0.3), block(), two_blocks()],
    ids=["Example 1", "space", "pair"],
)
def test_a_problem_of_forms_has_the_results_of_its_scene(scene, tmp_path):
    """Figures, files and tables of the same problem as a scene and as UFL; what forms cannot say is
    absent by name.
    """
    folder, solution = shared_folder(tmp_path), solve(scene)
    problem, _ = as_forms(solution.statement, solution.model.tagged)
    for results in ("stress", "errors", "solution"):
        with pytest.raises(RuntimeError, match="no solution so far"):
            getattr(problem, results)
    problem.solve()
    assert problem.solution.model.scales.modulus == pytest.approx(
        solution.model.scales.modulus, rel=1e-9
    )
    of_scene = write_results(solution, folder / "scene", pictures=False)
    of_forms = problem.write(folder / "forms", title=scene.title, pictures=False)
    for rows in (of_scene["stress"], of_scene["stress"]["recovered"]):
        # Of forms it is not known where the stress has no limit.
        assert rows["von_mises"].pop("error") > 0
    assert differences(of_scene, of_forms) == []
    assert of_scene.keys() - of_forms.keys() <= {"friction_used", "no_limit_of_pressure"}
    assert of_forms.keys() <= of_scene.keys()
    assert not {"material", "traction", "displacement", "units"} & of_forms["scene"].keys()
    assert of_forms["scene"]["forms"] == ["a", "L", "stress"]
    if COMM.rank == 0:
        written = files_in(folder / "scene")
        assert files_in(folder / "forms") == written
        assert {"summary.json", "contact.csv", "fields.vtu", "history.csv"} < set(written)
        read, expected = (read_results(folder / name) for name in ("forms", "scene"))
        assert read.tables == expected.tables
        ours, theirs = read.table("contact"), expected.table("contact")
        assert ours.keys() == theirs.keys()
        assert (ours["boundary"] == theirs["boundary"]).all()
        np.testing.assert_allclose(
            ours["pressure"], theirs["pressure"], atol=1e-11 * theirs["pressure"].max(), rtol=0
        )
        summary = json.loads((folder / "forms/summary.json").read_text())
        jsonschema.Draft202012Validator(summary_schema()).validate(summary)


def test_derivatives_of_quantities_of_scenes():
    """A mean displacement by name, and a force by the name of its contact or its number."""
    solution = solve(example1(coefficient=0.3, nx=12, ny=4, poisson=0.3))
    tagged = solution.model.tagged
    problem, factor = as_forms(solution.statement, tagged)
    u = problem.solve()
    mean, form = (
        problem.gradient(of, factor) for of in ("mean top y", u[1] / 3 * on(tagged, "top"))
    )
    assert (mean.value, mean.derivatives[0]) == pytest.approx(
        (form.value, form.derivatives[0]), rel=1e-9
    )
    force, same = (problem.gradient(f"force {name} y", factor) for name in ("bottom", "0"))
    assert force.derivatives == pytest.approx([20.0], rel=1e-6)
    assert force.derivatives == pytest.approx(same.derivatives)
