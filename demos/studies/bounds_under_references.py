"""Random scenes with guaranteed bounds, under solutions on finer meshes.

    ./env python3 demos/studies/bounds_under_references.py [COUNT] [FIRST] [KIND ...]

prints of so many scenes of each kind the bound over the true error, and what the finer solution
says against the bounds of the energy and of the contact force; then a table of kinds,
``docs/evidence/bounds_under_references.csv``.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI
from dolfinx import fem

from signorini_fx.errors import SignoriniError
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))
from scenes import alone

# Dimension and number of bodies by kind.
KINDS = {
    "one body: plane": (2, 1),
    "two bodies: plane": (2, 2),
    "one body: space": (3, 1),
    "two bodies: space": (3, 2),
}
# Bounds that are a smaller share of the solution are those of round-off, and the solution is exact.
ROUND_OFF = 1e-6
_SIDES = ("length", "width", "height")


def drawn(kind, seed):
    """A random scene of one load step: blocks that are pressed onto a foundation or each other."""
    (d, bodies), chance = KINDS[kind], np.random.default_rng([seed, list(KINDS).index(kind)])
    pick, up = chance.choice, "xyz"[d - 1]
    size, high = chance.uniform(0.7, 1.5, d - 1), chance.uniform(0.5, 1.2, bodies)
    young = 10 ** chance.uniform(2, 4, bodies)
    stress = 1e-3 * float(young.min())
    meshes, lower = [], {}
    cells = chance.integers(2, 7 if d == 2 else 4, d - 1)
    for number in range(bodies):
        sizes, shape = size, cells
        if number and chance.random() < 0.7:  # does not match
            shape = chance.integers(2, 8 if d == 2 else 4, d - 1)
            if chance.random() < 0.6:
                sizes = size * chance.uniform(0.7, 1.6)
                lower["shift"] = [*map(float, size * chance.uniform(-0.3, 0.1, d - 1)), 0.0]
        lengths = dict(
            zip(("length", "height") if d == 2 else _SIDES, [*sizes, high[number]], strict=True)
        )
        counts = dict(zip(("nx", "ny", "nz"), [*shape, chance.integers(2, 4)], strict=False))
        meshes.append(
            {
                "generator": "rectangle" if d == 2 else "box",
                "parameters": {key: float(value) for key, value in lengths.items()}
                | {key: int(value) for key, value in counts.items()}
                | {"cell": "triangle" if d == 2 else "tetrahedron"},
            }
        )
    friction = {"law": "none"}
    if chance.random() < 0.5:
        bound = stress * 10 ** chance.uniform(-1.5, 0)
        friction = {"law": "tresca", "bound": pick([f"{bound}", f"{bound} * (2 - x[0])"])}
    deep = 1e-3 * float(chance.uniform(0, 2))
    contact = {
        "gap": str(pick(["0.0", f"{deep}*(x[0] - 0.4)**2", f"{deep}*x[0]"])),
        "friction": friction,
    }
    names = ["upper.", "lower."] if bodies == 2 else [""]
    held = bool(chance.random() < 0.6)
    sliding = [{"boundary": f"{names[0]}left", "x": 0.0}]
    sliding += [{"boundary": f"{names[0]}front", "y": 0.0}] if d == 3 else []
    if held:
        down = 3e-3 * float(chance.uniform(0.5, 2))
        aside = dict.fromkeys("xy"[: d - 1], 1e-3 * float(chance.normal()))
        tilt = down / size[0] * float(chance.uniform(-0.8, 0.8))
        sliding = [{"boundary": f"{names[0]}top", **aside, up: f"{-down} + {tilt}*x[0]"}]
    loads = [{"boundary": f"{names[0]}right", "x": f"{stress * chance.normal()}*x[{d - 1}]"}]
    if not held:
        loads.append(
            {
                "boundary": f"{names[0]}top",
                up: f"{-stress}*(1.2 + {chance.uniform(-1, 1) / size[0]}*x[0])",
            }
        )
    scene = {
        "element": {"degree": int(pick([1, 1, 2]))},
        "displacement": sliding,
        "traction": loads,
        "solver": {"algorithm": str(pick(["auto", "alm", "ssn"]))},
    }
    if chance.random() < 0.4:
        scene["body_force"] = {up: str(pick([f"{-stress}", f"{-stress}*x[0]"])), "x": stress / 3}
    plane = {"hypothesis": str(pick(["plane strain", "plane stress"]))} if d == 2 else {}
    materials = [
        {"young": float(e), "poisson": float(pick([0.0, 0.3, 0.45, -0.2])), **plane} for e in young
    ]
    if chance.random() < 0.2:
        constants = {"young": (1.0, 0.4, 0.2), "shear": (0.2, 0.15, 0.3)}
        constants = {
            key: [float(young[0] * f) for f in factors] for key, factors in constants.items()
        }
        materials[0] = {"orthotropic": {**constants, "poisson": [0.2, 0.1, 0.15]}, **plane}
    if bodies == 1:
        contact["boundary"] = "bottom"
        return parse_scene(
            {**scene, "mesh": meshes[0], "material": materials[0], "contact": contact}
        )
    for material, name in zip(materials, ("upper", "lower"), strict=True):
        material["region"] = name
    scene["displacement"] = [
        *sliding,
        {"boundary": "lower.bottom", **dict.fromkeys("xyz"[:d], 0.0)},
    ]
    contact |= {
        "boundary": "upper.bottom",
        "against": "lower.top",
        "points": str(pick(["boundary", "against"])),
    }
    above = {"name": "upper", "mesh": meshes[0], "shift": [*[0.0] * (d - 1), float(high[1])]}
    both = [above, {"name": "lower", "mesh": meshes[1], **lower}]
    return parse_scene({**scene, "body": both, "material": materials, "contact": contact})


def on_finer_mesh(scene):
    """The scene on cells that are four times finer, in 3D twice, of degree 2."""
    tagged = load_mesh(scene, MPI.COMM_SELF)
    for _ in range(2 if tagged.dimension == 2 else 1):
        tagged = refine(tagged)
    element = scene.element.model_copy(update={"degree": 2})
    solver = scene.solver.model_copy(update={"algorithm": "alm"})
    return alone(
        scene.model_copy(update={"mesh": tagged, "body": (), "element": element, "solver": solver})
    )


def energy_of_difference(coarse, fine):
    """Energy norm of the difference of two displacements on nested meshes, the second one finer and
    of degree 2.
    """
    d, (t, space) = (
        fine.model.tagged.dimension,
        (fine.model.tagged.mesh, fine.displacement.function_space),
    )
    cells = coarse.model.tagged.mesh
    x = cells.geometry.x[compat.geometry_cells(cells)][..., :d]
    inverse = np.linalg.inv((x[:, 1:] - x[:, :1]).transpose(0, 2, 1))
    nodes = coarse.displacement.x.array.reshape(-1, d)[
        coarse.displacement.function_space.dofmap.list
    ]
    element = coarse.displacement.function_space.element.basix_element
    places = space.tabulate_dof_coordinates()[:, :d]
    difference = fem.Function(space)
    values = difference.x.array.reshape(-1, d)
    for dofs, middle in zip(
        space.dofmap.list, t.geometry.x[compat.geometry_cells(t)][..., :d].mean(axis=1), strict=True
    ):
        local = np.einsum("nij,nj->ni", inverse, middle - x[:, 0])
        owner = int(
            np.minimum(local.min(axis=1), 1 - local.sum(axis=1)).argmax()
        )  # the cell of the same body
        at = (places[dofs] - x[owner, 0]) @ inverse[owner].T
        values[dofs] = element.tabulate(0, at)[0, :, :, 0] @ nodes[owner]
    difference.x.array[:] -= fine.displacement.x.array
    forces = fine.model.forces_of(difference.x.array)
    return float(np.sqrt(forces @ difference.x.array[: forces.size]))


def judged(scene):
    """Bound over true error, the bound relative to the solution, and what is refuted; or why there
    is no bound.
    """
    try:
        solution = alone(scene)
        bound = solution.error_bound
        if isinstance(bound, str):
            return bound
        reference = on_finer_mesh(scene)
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    true, wrong = energy_of_difference(solution, reference), []
    low, high = bound.strain_energy
    if not low <= reference.steps[-1].strain_energy <= high:
        wrong.append("strain energy")
    contact, d = solution.statement.contact[0], solution.model.dimension
    interval = solution.force_bounds(contact.boundary, tuple(np.eye(d)[d - 1]))
    width = np.nan
    if not isinstance(interval, str):
        sign = -1.0 if reference.model.statement.contact[0].boundary != contact.boundary else 1.0
        force = sign * float(reference.contact.forces_of_each[0].sum(axis=0)[d - 1])
        width = (interval[1] - interval[0]) / max(abs(force), 1e-300)
        if not interval[0] - 1e-6 * abs(force) <= force <= interval[1] + 1e-6 * abs(force):
            wrong.append(f"force {interval[0]:.5g} {force:.5g} {interval[1]:.5g}")
    if bound.error < true and bound.relative > ROUND_OFF:
        wrong.append("error")
    return bound.error / true if true > 0 else np.inf, bound.relative, wrong, width


def main(count, first, kinds):
    """Print each scene, and the table."""
    rows = []
    for kind in kinds:
        ratios, refused, refuted, exact = [], 0, [], 0
        for seed in range(first, first + count):
            begin, found = time.process_time(), judged(drawn(kind, seed))
            seconds = time.process_time() - begin
            if isinstance(found, str):
                refused += 1
                print(f"{kind} {seed}: {found}", flush=True)
                continue
            ratio, relative, wrong, width = found
            exact += relative < ROUND_OFF
            ratios += [ratio] if relative >= ROUND_OFF else []
            refuted += [seed] if wrong else []
            print(
                f"{kind} {seed}: {ratio:.3f} bound {relative:.1e} force {width:.1e} {wrong or ''} "
                f"({seconds:.0f} s)",
                flush=True,
            )
        figures = (
            [f"{f(ratios):.3f}" for f in (np.min, np.median, np.max)] if ratios else ["", "", ""]
        )
        rows.append([kind, count, count - refused, exact, len(refuted), *figures])
    writer = csv.writer(sys.stdout)
    writer.writerow(["kind", "scenes", "bounded", "exact", "refuted", "least", "median", "largest"])
    writer.writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int, nargs="?", default=15)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("kinds", nargs="*", default=list(KINDS))
    main(**vars(parser.parse_args()))
