"""Scenes with nonlinear materials: what is refused, what ``check`` says, and the result folder."""

from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from commands import summary_in
from mpi4py import MPI
from scene_tables import box_mesh, fixed, plane_shape, rectangle_mesh
from scenes import alone
from support.nonlinear_scenes import block, indented, material

from signorini_fx import SceneError, extensions, read_results, solve, write_results
from signorini_fx.extensions import KINEMATICS
from signorini_fx.mechanics.kinematics import PLANE_STRAIN
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.template import summary_schema

RUBBER = material("neo-hooke")
CIRCLE = {"shape": "circle", "centre": [0.8, 1.5], "radius": 0.5, "shift": [0.0, "-0.2*t"]}


def contact(**changes):
    """The contact of ``indented`` with some of its keys changed."""
    return {"boundary": "top", "foundation": CIRCLE} | changes


REFUSED = {
    "a nonlinear material in plane stress": {"material": RUBBER | {"hypothesis": "plane stress"}},
    "torsion: a nonlinear material with torsion|a nonlinear material with torsion": {
        "material": RUBBER | {"hypothesis": "axisymmetric", "torsion": True}
    },
    "element.volumetric: a pressure as an unknown": {
        "element": {"degree": 2, "volumetric": "mixed"}
    },
    "element.volumetric: 'reduced' needs an energy of the volume": {
        "material": material("saint-venant-kirchhoff"),
        "element": {"volumetric": "reduced"},
    },
    "solver.error_bound: a nonlinear body has no guaranteed bound": {
        "solver": {"error_bound": True}
    },
    "solver.regularisation_error: must be a number": {"solver": {"algorithm": "path-following"}},
    "accuracy.of: must be 'energy', 'pressure' or 'force' for a nonlinear body": {
        "accuracy": {"target": 0.05, "of": "peak"}
    },
    "accuracy.of: cannot be estimated where cells lock": {
        "material": RUBBER | {"poisson": 0.49},
        "accuracy": {"target": 0.05, "of": "force"},
    },
    "material.grading: is not possible yet": {"material": RUBBER | {"grading": "1/(1+x[0])"}},
    "contact[0].foundation.pivot: give the point": {
        "contact": contact(foundation=CIRCLE | {"shift": [0.0, 0.0], "force": [0.0, -1.0]}),
        "load_steps": {},
    },
    "contact[0].kind: 'bonded' is not possible yet: nonlinear bodies": {
        "contact": {
            "boundary": "top",
            "kind": "bonded",
            "foundation": CIRCLE
            | {"shift": [0.0, 0.0], "force": [0.0, -1.0], "prescribed": {"rotation": 0.0}},
        },
        "load_steps": {},
    },
    "fluid: changes as the body moves": {
        "fluid": {"boundary": "left", "level": 1.0, "weight": 1.0}
    },
    "displacement.rotation: is a small rotation": {
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0, "rotation": 0.1}
    },
    "there is no material 'neohooke'": {"material": RUBBER | {"law": "neohooke"}},
    "material.poisson: must be less than 0.5": {"material": RUBBER | {"poisson": 0.5}},
    "material.young: must be greater than 0": {"material": RUBBER | {"young": -1.0}},
    "material.mu[1]: must have the sign of its exponent": {
        "material": material("ogden", mu=[40.0, -2.0, -5.0])
    },
    "material.alpha: has 1 exponents, one for each of 3": {
        "material": material("ogden", alpha=[2.0])
    },
    "material.hardening[1]: plastic strains must increase": {
        "material": material("j2", hardening=[[0.1, 2e3], [0.2, 1.5e3]])
    },
    "material.c10: must be above 0, or c01": {
        "material": material("mooney-rivlin", c10=0.0, c01=0.0)
    },
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_refused(message):
    """By one error that names the place and the way out, before anything is solved, by ``check``
    too.
    """
    begins = message.split("|")[-1]
    for use in (solve, check_scene):
        with pytest.raises(SceneError) as refused:
            use(indented(RUBBER, **REFUSED[message]), MPI.COMM_SELF)
        assert begins in str(refused.value)
        assert len(str(refused.value).splitlines()) == 1


def test_kinematics_of_another_package_are_refused(monkeypatch):
    """They do not say what finite strains are."""
    odd = replace(PLANE_STRAIN, words="odd")
    monkeypatch.setattr(extensions, "_registered", {KINEMATICS: {"odd": odd}})
    with pytest.raises(SceneError, match="hypothesis: that of another package is not possible yet"):
        indented(RUBBER | {"hypothesis": "odd"})


def test_ogden_in_space_is_refused():
    """Three stretches at once are not derived."""
    cube = box_mesh(1, 1, 1)
    plate = plane_shape([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    scene = indented(
        material("ogden"),
        mesh=cube,
        contact={"boundary": "top", "foundation": plate},
        load_steps={},
    )
    with pytest.raises(SceneError, match=r"material\[0\].law: 'ogden' is not possible in 3D yet"):
        alone(scene)


def test_check():
    """It says what will be solved: Newton's method, the material, and what each load step may
    take.
    """
    checked = check_scene(indented(material("j2", yield_stress=5.0)), MPI.COMM_SELF)
    acts = "; ".join(checked.acts)
    assert "small strains, Newton's method" in checked.acts[0]
    assert "yield_stress = 5" in acts
    assert "elasticity" not in acts
    assert checked.cost.linear_solves[0] >= 10
    assert not checked.warnings
    locking = check_scene(
        indented(
            RUBBER | {"poisson": 0.499},
            mesh=rectangle_mesh(4, 4, cell="triangle"),
            contact={"boundary": "top", "foundation": plane_shape([0.0, 2.0], [0.0, -1.0])},
            load_steps={},
        ),
        MPI.COMM_SELF,
    )
    assert "too stiff" in locking.warnings[0].message


def test_folder(tmp_path):
    """That of a scene: its own title, names, units and load steps; what makes no sense is left
    out.
    """
    path = {"times": [1.0, 2.0], "names": ["press", "slide"], "steps": 2}
    scene = indented(
        RUBBER, title="Rubber", units={"length": "mm", "stress": "MPa"}, load_steps=path
    )
    solution = alone(scene)
    summary = write_results(solution, tmp_path, pictures=False)
    assert not {"strain_energy", "friction_used", "plastic_strain"} & set(summary)
    assert summary["stress"]["recovered"] is summary["stress"]["error"] is None
    jsonschema.Draft202012Validator(summary_schema()).validate(summary_in(tmp_path))
    assert summary["scene"]["material"][0]["law"] == "neo-hooke"
    assert summary["title"] == "Rubber"
    rows = read_results(tmp_path).summary.steps
    assert [(row.time, row.name) for row in rows] == [
        (0.5, "press"),
        (1.0, "press"),
        (1.5, "slide"),
        (2.0, "slide"),
    ]
    assert summary["contact_boundaries"][0]["boundary"] == "top"
    bottom, top = (solution.resultants.of(name).force for name in ("bottom", "top"))
    assert np.abs(bottom + top).max() < 1e-8 * np.abs(top).max()
    assert solution.error_bound == "a nonlinear body has no guaranteed bound"
    assert "error of the stress took" in str(solution.cost)
    # Both ends of what is glued.
    assert str(solution.cost).endswith(
        ("unless cells fold at (0, 0)", "unless cells fold at (2, 0)")
    )


@pytest.mark.mpi
@pytest.mark.one_quick("law", ["neo-hooke", "j2"])
def test_resultants(law):
    """Of supports, contact and loads, at each load step, in balance; moments, too, of finite
    strains at the displaced points and of small ones at the undeformed points: the metal yields,
    and slides under the circle.
    """
    loads = {
        "traction": {"boundary": "right", "x": 2.0, "factors": [0.5, 1.0]},
        "body_force": {"y": -1.0},
    }
    further = {"yield_stress": 2.0, "hardening": 20.0} if law == "j2" else {}
    solution = solve(indented(material(law, **further), **loads), MPI.COMM_WORLD)
    for step, factor in zip(solution.steps, (0.5, 1.0), strict=True):
        resultants = solution.at(step).resultants
        parts = {name: resultants.of(name) for name in ("bottom", "top", "right")}
        assert parts["right"].force == pytest.approx([2.0 * factor, 0.0], abs=1e-12)
        pressed = np.abs(parts["top"].force).max()
        total = sum(part.force for part in parts.values()) - np.array([0.0, 2.0])
        assert np.abs(total).max() < 1e-8 * pressed
        assert abs(sum(part.moment for part in resultants.every())) < 1e-8 * pressed


def drawn_out(law, **further):
    """A block that is drawn out to three times its length, away from its foundation."""
    held = [fixed("left", "x"), {"boundary": "right", "x": "t"}, fixed("bottom", "y")]
    further = {"displacement": held, "load_steps": {"times": [0.2, 2.0]}} | further
    return alone(block(material(law), "0", cells=(3, 3), **further), check=False)


@pytest.mark.slow
def test_small_strains_that_are_not_small_are_no_solution():
    """A metal at small strains says so, as a linear body does; rubber may be drawn out, and so may
    who wants it.
    """
    solution = drawn_out("j2")
    assert solution.status is Status.TOO_LARGE
    assert all(step.deformation.largest <= 0.5 for step in solution.steps)
    assert "of small strains at most 0.5" in solution.findings[0].message
    for law, further in (("neo-hooke", {}), ("j2", {"solver": {"largest_deformation": 3.0}})):
        reached = drawn_out(law, **further)
        assert reached.status is Status.CONVERGED
        assert reached.steps[-1].deformation.largest > 1
