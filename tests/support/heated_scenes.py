"""Random scenes with thermal strain, and true errors of their displacements against solutions on finer meshes.

    ./env python3 tests/support/heated_scenes.py plane | space | pair | spatial-pair | shape | pressed [SEEDS] [FIRST]

prints guaranteed bounds over true errors, and what the finer solutions say against other bounds.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2]))

import bounds_of_pairs
import bounds_on_shapes
import error_bounds
import error_bounds_in_space
import pairs_in_space
from scenes import alone

from signorini_fx.addons.bounds.error_bound import error_bound
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein
from signorini_fx.addons.bounds.varying_springs import SpringPoints
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.effects.springs import Springs
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.scenes.reading import parse_scene

STUDIES = {"plane": error_bounds, "space": error_bounds_in_space, "pair": bounds_of_pairs} | dict.fromkeys(
    ("shape", "pressed"), error_bounds
)
STUDIES["spatial-pair"] = SimpleNamespace(
    drawn=pairs_in_space.drawn,
    on_finer_mesh=pairs_in_space.on_finer_mesh,
    problem=error_bounds_in_space.problem,
    energy_of_difference=error_bounds_in_space.energy_of_difference,
)


def temperatures(chance, axes, length):
    """Functions of the position, polynomials and one that jumps, of the size of a strain."""
    heat = 1e-3 * float(10 ** chance.uniform(-1, 0.7))
    up = f"x[{axes - 1}]"
    return str(
        chance.choice(
            [
                f"{heat}",
                f"{heat}*x[0]",
                f"{heat}*(x[0] - {length / 2})**2 + {heat}*{up}",
                f"{heat}*x[0]*{up}**2 - {heat}*{up}",
                f"where(x[0] < {0.37 * length}, {heat}, {-heat / 2}*{up})",
            ]
        )
    )


def heated(scene, seed):
    """The scene with a thermal strain, in the plane also in plane stress, and in half of the scenes made of an
    orthotropic material that expands alike in all directions or not."""
    chance, tagged = np.random.default_rng([seed, 31]), scene.mesh
    plane = not hasattr(tagged, "mesh") or tagged.mesh.geometry.dim == 2
    plane &= not (scene.body and len(scene.body[0].shift) == 3)
    length = 1.0 if scene.body or not plane else float(scene.mesh.parameters["length"])
    hypothesis = str(chance.choice(["plane strain", "plane stress"]))
    material = []
    for one in scene.material:
        more = {"expansion": float(chance.choice([1.0, 0.5]))} | ({"hypothesis": hypothesis} if plane else {})
        material.append(one.model_copy(update=more))
    if chance.random() < 0.3:
        young = float(scene.material[0].young)
        material = [
            {
                "orthotropic": {
                    "young": [young, young / 2, young / 3],
                    "poisson": [0.2, 0.25, 0.1],
                    "shear": [young / 4, young / 5, young / 3],
                    "direction": [1.0, 0.4, 0.0][: 2 if plane else 3],
                },
                "expansion": float(chance.choice([1.0, 0.5])),
                "region": one.region,
            }
            | ({"hypothesis": hypothesis} if plane else {})
            for one in scene.material
        ]
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    change = temperatures(chance, 2 if plane else 3, length)
    return parse_scene(fields | {"material": material, "temperature": [{"change": change}]})


def drawn(kind, seed, change=heated):
    """A scene of a study: in the plane, on a foundation with a shape or pressed onto it by a support, in space, or of
    two bodies; ``change``: what is made of the scene and the seed.
    """
    if kind == "shape":
        return change(bounds_on_shapes.on_shape(error_bounds.drawn(seed), seed), seed)
    return change(error_bounds.pressed(seed) if kind == "pressed" else STUDIES[kind].drawn(seed), seed)


def effectivity(kind, seed, change=heated):
    """Bound over true error, the bound, and what the finer solution refutes; or why there is none."""
    study, scene = STUDIES[kind], drawn(kind, seed, change)
    try:
        solution = alone(scene)
        bound = error_bound(solution.model, solution.displacement, solution.contact)
        if isinstance(bound, str):
            return bound
        reference = study.on_finer_mesh(scene)
        true = np.hypot(study.energy_of_difference(solution, reference), in_springs(solution, reference, study.problem))
    except (SignoriniError, Refused) as failed:
        return str(failed).splitlines()[0]
    return bound.error / true, bound, refuted(solution, reference, bound)


def in_springs(solution, reference, problem):
    """Root of twice the energy in springs of the difference of two displacements on nested meshes, the second one
    finer; zero without springs."""
    coarse, fine = problem(solution), problem(reference)
    entries, d = solution.statement.of(Springs), fine.t.dimension
    points, weights = POINTS[d], WEIGHTS[d]
    square = 0.0
    for entry in entries:
        facets, coarse_facets = fine._facets(entry.boundary), coarse._facets(entry.boundary)
        corners = coarse.t.x[coarse.t.facets[coarse_facets]]
        x = np.einsum("qc,fcd->fqd", points, fine.t.x[fine.t.facets[facets]])
        # The coarse facet that each fine one is on: where the middle has the largest least barycentric coordinate, and
        # is in its plane.
        sides = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
        inverse = np.linalg.pinv(sides)
        away = x.mean(axis=1)[:, None] - corners[:, 0]
        local = np.einsum("ckd,fcd->fck", inverse, away)
        off = np.linalg.norm(np.einsum("cdk,fck->fcd", sides, local) - away, axis=2)
        least = np.minimum(local.min(axis=2), 1 - local.sum(axis=2)) - 1e6 * off / np.ptp(coarse.t.x)
        owner = least.argmax(axis=1)
        assert (least.max(axis=1) > 0).all()
        rest = np.einsum("fkd,fqd->fqk", inverse[owner], x - corners[owner, :1])
        places = np.concatenate((1 - rest.sum(axis=2, keepdims=True), rest), axis=2)
        of_coarse = coarse.on_facets(coarse.y, coarse.middle, coarse_facets)[owner]
        own = np.stack([bernstein(at) @ values for at, values in zip(places, of_coarse, strict=True)])
        apart = bernstein(points) @ fine.on_facets(fine.y, fine.middle, facets) - own
        at = SpringPoints(x, np.broadcast_to(fine.t.normal[facets][:, None], x.shape), apart)
        square += float(fine.t.area[facets] @ (entry.reaction_at(at) * apart).sum(axis=2) @ weights)
    return float(np.sqrt(square))


def refuted(solution, reference, bound):
    """What a finer solution says against the bounds of the strain energy and of contact forces."""
    wrong, energy = [], reference.last_step.strain_energy
    low, high = bound.strain_energy
    if not low * (1 - 1e-9) <= energy <= high * (1 + 1e-9):
        wrong.append(f"energy {low:.5g} {energy:.5g} {high:.5g}")
    contact = solution.statement.contact[0]
    if solution.model.tagged.dimension == 2:
        found = solution.force_bounds(contact.boundary, (0.0, 1.0))
        theirs = found if isinstance(found, str) else reference.force_bounds(contact.boundary, (0.0, 1.0))
        if not isinstance(theirs, str) and max(found[0], theirs[0]) > min(found[1], theirs[1]):
            wrong.append(f"force {found} {theirs}")
    return wrong


def main(change):
    """Print a row for each seed, and a summary."""
    kind, many, first = sys.argv[1], *(int(word) for word in (*sys.argv[2:4], *("100", "0")[len(sys.argv[2:4]) :]))
    ratios = []
    for number in range(first, first + many):
        found = effectivity(kind, number, change)
        if isinstance(found, str):
            print(number, found, flush=True)
            continue
        ratio, bound, wrong = found
        ratios.append(ratio)
        shares = ", ".join(f"{name} {getattr(bound, name):.2g}" for name in ("duality", "moved", "data", "round_off"))
        print(f"{number} {ratio:.3f} true {bound.error / ratio / bound.size:.1%}: {shares} {wrong}", flush=True)
    least, middle, most = min(ratios), np.median(ratios), max(ratios)
    print(f"{len(ratios)} of {many}: {least:.3f}, {middle:.2f}, {np.quantile(ratios, 0.9):.2f}, {most:.2f}")


if __name__ == "__main__":
    main(heated)
