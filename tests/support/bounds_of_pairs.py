"""Random scenes of two bodies, and true errors of their displacements against solutions on finer meshes.

    ./env python3 tests/support/bounds_of_pairs.py [SEEDS] [FIRST]

prints a table of guaranteed bounds over true errors, like those of ``docs/evidence/bounds_of_pairs.csv``.
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

sys.path.append(str(Path(__file__).resolve().parents[2]))

from scenes import alone

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.preloaded_sections import preloaded_sections
from signorini_fx.addons.bounds.split_triangles import barycentric
from signorini_fx.addons.bounds.stress_products import energy
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene


def problem(solution):
    """The solution as plain arrays, cells at the contact divided."""
    return Bounded(solution.model, solution.displacement, solution.contact, solution._position, solution._before)


def _strained(solution):
    """The cells of a solution, and their strain at corners with that of preloaded sections."""
    case, space = problem(solution), solution.displacement.function_space
    t = case._undivided
    strain = t.strain_at_corners(*case._on_cells(solution.displacement))
    for section in preloaded_sections(solution.model, space, solution._position):
        of_section = t.strain_at_corners(*case._on_cells(section.moved))
        strain[section.beyond] += section.amount * of_section[section.beyond]
    return t, strain


def energy_of_difference(coarse, fine):
    """Energy norm of the difference of the displacements of two solutions on nested meshes, the second one finer."""
    (c, strain), (t, finer) = map(_strained, (coarse, fine))
    local = (np.ones((3, 3)) + 3 * np.eye(3)) / 6  # three points inside, exact for linear strains
    x = np.einsum("qc,ncd->nqd", local, t.x[t.corners])
    middles = t.x[t.corners].mean(axis=1)
    # The cell of the coarse mesh of the same body that a middle is in: among the nearest ones.
    near = cKDTree(c.x[c.corners].mean(axis=1)).query(middles, k=min(40, len(c.corners)))[1]
    inside = np.stack([barycentric(c, near[:, k], middles).min(axis=1) for k in range(near.shape[1])], axis=1)
    owner = np.take_along_axis(near, inside.argmax(axis=1)[:, None], axis=1)[:, 0]
    assert (inside.max(axis=1) > 0).all()
    own = strain[owner]
    at = np.stack([barycentric(c, owner, x[:, q]) for q in range(3)], axis=1)
    difference = np.einsum("qc,nck->nqk", local, finer) - at @ own
    product = (t.stress(difference) * difference * [1, 1, 2]).sum(axis=2)
    return float(np.sqrt((t.volume[:, None] / 3 * product).sum()))


def on_finer_mesh(scene, times=2, degree=2):
    """The scene on triangles that are four times finer, of degree 2."""
    tagged = load_mesh(scene, MPI.COMM_SELF)
    for _ in range(times):
        tagged = refine(tagged)
    element = scene.element.model_copy(update={"degree": degree})
    return alone(scene.model_copy(update={"mesh": tagged, "body": (), "element": element}))


def effectivity(scene, finer=on_finer_mesh, distance=energy_of_difference):
    """Guaranteed bound over the true error, both relative to the solution, the bound, the solution, and that of
    ``finer``, which the true error is the distance from; or why there is none."""
    try:
        solution = alone(scene)
        bound = error_bound(solution.model, solution.displacement, solution.contact)
        if isinstance(bound, str):
            return bound
        reference = finer(scene)
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    true = distance(solution, reference)
    return bound.error / true, bound.error / bound.size, true / bound.size, bound, solution, reference


def drawn(seed, **kinds):
    """Two random blocks, one on the other, of one load step.

    Args:
        seed: of the draw.
        kinds: what is not drawn: ``friction``, ``held`` (by contact alone), ``degree``, ``kind`` of the contact.
    """
    chance = np.random.default_rng([seed, 7])
    pick = chance.choice
    width, height = chance.uniform(0.6, 1.6), chance.uniform(0.5, 1.2, 2)
    wide = width * float(pick([1.0, 1.0, 1.5, 0.7]))
    aside = 0.0 if wide == width else float(chance.uniform(-0.3, 0.1)) * width
    young, poisson = 10 ** chance.uniform(2, 4, 2), pick([0.0, 0.3, 0.45], 2)
    size = 1e-3 * float(young.min())
    meshes = [
        {
            "generator": "rectangle",
            "parameters": {
                "length": float(length),
                "height": float(h),
                "nx": int(chance.integers(2, 8)),
                "ny": int(chance.integers(2, 5)),
                "cell": "triangle",
            },
        }
        for length, h in zip((width, wide), height, strict=True)
    ]
    apart = kinds.get("apart", float(chance.uniform(0, 2e-3)) if chance.random() < 0.3 else 0.0)
    deep = 1e-3 * float(chance.uniform(0, 2))
    gap = pick(["0.0", f"{deep}*(x[0] - 0.4)**2", f"{deep}*abs(x[0] - 0.5)", f"{-deep / 3}"])
    friction = {"law": "none"}
    if kinds.get("friction", chance.random() < 0.5):
        friction, apart = {"law": "tresca", "bound": float(size * 10 ** chance.uniform(-1.5, 0))}, 0.0
    held = kinds.get("held", bool(chance.random() < 0.7))
    scene = {
        "body": [
            {"name": "upper", "mesh": meshes[0], "shift": [0.0, float(height[1] + apart)]},
            {"name": "lower", "mesh": meshes[1], "shift": [aside, 0.0]},
        ],
        "element": {"degree": kinds.get("degree", 1)},
        "material": [
            {"region": name, "young": float(e), "poisson": float(nu)}
            for name, e, nu in zip(("upper", "lower"), young, poisson, strict=True)
        ],
        "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}],
        "traction": [{"boundary": "upper.right", "x": size * float(chance.normal())}],
        "contact": {
            "boundary": "upper.bottom",
            "against": "lower.top",
            "points": str(pick(["boundary", "against", "auto"])),
            "gap": str(gap),
            "kind": kinds.get("kind", "unilateral"),
            "friction": friction,
        },
    }
    if scene["contact"]["kind"] == "bonded":
        for key in ("gap", "friction"):
            del scene["contact"][key]
    if held:
        down = 3e-3 * float(chance.uniform(0.5, 2))
        tilt = down / width * float(chance.uniform(-0.8, 0.8))
        scene["displacement"].append(
            {"boundary": "upper.top", "x": 1e-3 * float(chance.normal()), "y": f"{-down} + {tilt}*x[0]"}
        )
    else:
        scene["displacement"].append({"boundary": "upper.left", "x": 0.0})
        cells = meshes[0]["parameters"]["nx"]
        middle = width / cells * float(chance.integers(1, cells))  # at a node
        scene["traction"].append({"boundary": "upper.top", "y": f"where(x[0] < {middle}, {-2 * size}, {-size})"})
    if chance.random() < 0.3:
        scene["body_force"] = {"y": -size}
    return parse_scene(scene)


def refuted(solution, reference, bound):
    """What the solution on a finer mesh says against the bounds of the energy and of the contact force, which are wider
    than the error of that solution."""
    wrong, size = [], float(np.sqrt(energy_norm_square(reference)))
    low, high = bound.strain_energy
    if not low <= size**2 / 2 <= high:
        wrong.append("strain energy")
    if isinstance(found := solution.force_bounds(solution.statement.contact[0].boundary, (0.0, 1.0)), str):
        return wrong
    slave = solution.model.pairs[0].slave.facets
    named = solution.model.tagged.facets(solution.statement.contact[0].boundary)
    sign = 1.0 if np.array_equal(np.sort(slave), np.sort(named)) else -1.0
    force = sign * float(reference.contact.forces_of_each[0].sum(axis=0)[1])
    tiny = 1e-6 * abs(force)
    if not found[0] - tiny <= force <= found[1] + tiny:
        wrong.append(f"force {found[0]:.4g} {force:.4g} {found[1]:.4g}")
    return wrong


def energy_norm_square(solution):
    """Twice the strain energy of a solution, per thickness."""
    case = problem(solution)
    t = case._undivided
    return energy(t, t.strain_at_corners(*case._on_cells(solution.displacement))).sum()


def table(seeds, **kinds):
    """Rows of all seeds."""
    for seed in seeds:
        yield seed, effectivity(drawn(seed, **kinds))


if __name__ == "__main__":
    many, first = int(sys.argv[1]) if len(sys.argv) > 1 else 100, int(sys.argv[2]) if len(sys.argv) > 2 else 0
    ratios = []
    kinds = dict(word.split("=") for word in sys.argv[3:])
    kinds = {key: int(value) if value.isdigit() else value for key, value in kinds.items()}
    for number, found in table(range(first, first + many), **kinds):
        if isinstance(found, str):
            print(number, found, flush=True)
            continue
        ratio, relative, true, bound, solution, reference = found
        ratios.append(ratio)
        shares = ", ".join(f"{name} {getattr(bound, name):.2g}" for name in ("duality", "moved", "data", "round_off"))
        wrong = refuted(solution, reference, bound)
        print(f"{number} {ratio:.3f} bound {relative:.1%} true {true:.1%}: {shares} {wrong}", flush=True)
    print(f"{len(ratios)} of {many}: {min(ratios):.3f}, {np.median(ratios):.2f}, {np.quantile(ratios, 0.9):.2f}")
