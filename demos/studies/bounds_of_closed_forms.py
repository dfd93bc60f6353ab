"""Guaranteed bounds over true errors of two fields that end contact and stick as solutions of contact do.

    ./env python3 demos/studies/bounds_of_closed_forms.py --out results/bounds_of_closed_forms

A block [-1, 1] x [0, 1] on a rigid foundation, plane strain, loaded on its other three sides by the tractions of the
field, so that it is the exact solution; the displacement is of order r^(3/2) at the origin, as it is where any contact
ends and where any stick ends.  With z = x + i y and kappa = 3 - 4 nu:

- *contact ends*, without friction: Z = -C z^(1/2), s_xx = Re Z - y Im Z', s_yy = Re Z + y Im Z', s_xy = -y Re Z'
  (Westergaard); it is in contact where x > 0, with the pressure C x^(1/2);
- *stick ends*, with Tresca friction of bound g: potentials phi = i B z^(3/2), psi = -i (kappa + 3/2) B z^(3/2)
  (Kolosov) with the constant stresses s_yy = -p0, s_xy = g and s_xx that leaves e_xx = 0; it sticks where x > 0.

In the first one no friction holds it along the foundation: where it is open u_x = 0, which a support says there.
Coulomb's friction of coefficient g / p0 has the second field as its solution for nu = 1/2 alone, where p = p0
everywhere; that takes the mixed element, which has no bound.  Errors are integrals over the cells of what the computed
stress is off the exact one.  Written is bounds_of_closed_forms.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from dolfinx import mesh as dmesh

from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

Floats = npt.NDArray[np.float64]
YOUNG, POISSON = 1000.0, 0.3
# C of the first field; B, p0 and g of the second one.
OPENING, SLIDING, PRESSED, BOUND = 10.0, 1.0, 20.0, 5.0
COUNTS = (2, 4, 8, 16)
NEAR = 1e-9
# x, y, r and the parts of z^(1/2) in expressions of a scene.
X, Y, R = "x[0]", "x[1]", "sqrt(x[0]**2 + x[1]**2)"
REAL, IMAGINARY = f"sqrt(max(0, {R} + {X}) / 2)", f"sqrt(max(0, {R} - {X}) / 2)"


@dataclass(frozen=True)
class Field:
    """A field that is the exact solution.

    Attributes:
        stress: s_xx, s_yy, s_xy at points (x, y), shapes (n,) and (n,) to (3, n).
        tractions: expressions of s_xx, s_yy, s_xy.
        more: of the scene, beside its loads.
    """

    stress: Callable[[Floats, Floats], Floats]
    tractions: tuple[str, str, str]
    more: dict[str, object]


def _root(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Real and imaginary part of z^(1/2), y >= 0, and the distance from the origin."""
    r = np.hypot(x, y)
    return np.sqrt((r + x).clip(min=0.0) / 2), np.sqrt((r - x).clip(min=0.0) / 2), r


def opening(x: Floats, y: Floats) -> Floats:
    """The stress of the first field."""
    real, imaginary, r = _root(x, y)
    turned = y * OPENING / (2 * r)
    return np.array([-OPENING * real - turned * imaginary, -OPENING * real + turned * imaginary, turned * real])


def sliding(x: Floats, y: Floats, poisson: float = POISSON) -> Floats:
    """The stress of the second field."""
    kappa, along = _of(poisson)
    real, imaginary, r = _root(x, y)
    mean = -3 * SLIDING * imaginary
    steep, flat = 0.75 * SLIDING / r, 1.5 * SLIDING * (kappa + 1.5)
    half = steep * (x * imaginary + y * real) + flat * imaginary
    across = steep * (x * real - y * imaginary) - flat * real
    return np.array([mean - half + along, mean + half - PRESSED, across + BOUND])


def _of_opening() -> tuple[str, str, str]:
    turned = f"{OPENING / 2} * {Y} / {R}"
    first = f"-{OPENING} * {REAL} - {turned} * {IMAGINARY}"
    return first, f"-{OPENING} * {REAL} + {turned} * {IMAGINARY}", f"{turned} * {REAL}"


def _of(poisson: float) -> tuple[float, float]:
    """Kappa of the second field, and its constant s_xx."""
    return 3 - 4 * poisson, -PRESSED * poisson / (1 - poisson)


def _of_sliding(poisson: float = POISSON) -> tuple[str, str, str]:
    kappa, along = _of(poisson)
    steep, flat = 0.75 * SLIDING, 1.5 * SLIDING * (kappa + 1.5)
    mean = f"{-3 * SLIDING} * {IMAGINARY}"
    half = f"({steep} * ({X} * {IMAGINARY} + {Y} * {REAL}) / {R} + {flat} * {IMAGINARY})"
    across = f"{steep} * ({X} * {REAL} - {Y} * {IMAGINARY}) / {R} - {flat} * {REAL} + {BOUND}"
    return f"{mean} - {half} + {along}", f"{mean} + {half} - {PRESSED}", across


def _contact(**more: object) -> list[dict[str, object]]:
    return [{"boundary": name, **more} for name in ("left half", "right half")]


FIELDS = {
    "contact ends": Field(
        opening, _of_opening(), {"contact": _contact(), "displacement": {"boundary": "left half", "x": 0.0}}
    ),
    "stick ends": Field(sliding, _of_sliding(), {"contact": _contact(friction={"law": "tresca", "bound": BOUND})}),
}
COULOMB = Field(
    lambda x, y: sliding(x, y, 0.5),
    _of_sliding(0.5),
    {
        "contact": _contact(friction={"law": "coulomb", "coefficient": BOUND / PRESSED}),
        "element": {"degree": 2, "volumetric": "mixed"},
        "material": {"young": YOUNG, "poisson": 0.5},
        "solver": {},
    },
)


def rectangle(n: int) -> TaggedMesh:
    """[-1, 1] x [0, 1] in 2 n times n squares of two triangles, the bottom in two halves."""
    corners = [np.array([-1.0, 0.0]), np.array([1.0, 1.0])]
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, corners, [2 * n, n], diagonal=dmesh.DiagonalType.left_right)
    return tag_boundaries(
        mesh,
        {
            "left": lambda x: x[0] < -1 + NEAR,
            "right": lambda x: x[0] > 1 - NEAR,
            "top": lambda x: x[1] > 1 - NEAR,
            "left half": lambda x: (x[1] < NEAR) & (x[0] < NEAR),
            "right half": lambda x: (x[1] < NEAR) & (x[0] > -NEAR),
        },
    )


def scene_of(field: Field, n: int, degree: int) -> Scene:
    """The block with so many squares over its height."""
    along, up, across = field.tractions
    loads = [
        {"boundary": "left", "x": f"-({along})", "y": f"-({across})"},
        {"boundary": "right", "x": along, "y": across},
        {"boundary": "top", "x": across, "y": up},
    ]
    return parse_scene(
        {
            "mesh": rectangle(n),
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "traction": loads,
            "solver": {"algorithm": "alm"},
            **field.more,
        }
    )


def true_error(field: Field, problem: Bounded) -> tuple[float, float]:
    """Energy norms of the error and of the exact solution, integrated over the triangles of a problem."""
    t = problem.t
    places = np.einsum("qc,ncd->nqd", POINTS[3], t.x[t.corners])
    exact = np.moveaxis(field.stress(places[..., 0], places[..., 1]), 0, 2)
    own = np.einsum("qc,nck->nqk", POINTS[3], t.stress(t.strain_at_corners(problem.y, problem.middle)))

    def norm(stress: Floats) -> float:
        density = (stress * t.strain(stress) * [1.0, 1.0, 2.0]).sum(axis=2)
        return float(np.sqrt((t.volume * (density @ WEIGHTS[3])).sum()))

    return norm(own - exact), norm(exact)


@dataclass(frozen=True)
class Row:
    """One mesh; errors and bounds are relative to the energy norm of the exact solution."""

    field: str
    degree: int
    squares: int
    unknowns: int
    true: float
    bound: float
    least_energy: float
    energy: float
    greatest_energy: float
    force: float

    @property
    def ratio(self) -> float:
        """Bound over true error."""
        return self.bound / self.true


def row_of(name: str, n: int, degree: int) -> Row:
    """Solve, measure and bound.

    Raises:
        ValueError: there is no bound.
    """
    field = FIELDS[name]
    solution = solve(scene_of(field, n, degree), MPI.COMM_SELF, check=False)
    bound, table = solution.error_bound, solution.table.columns
    if bound is None or isinstance(bound, str):
        raise ValueError(f"{name}: {bound}")
    assert solution.displacement is not None
    true, size = true_error(field, Bounded(solution.model, solution.displacement, solution.contact, 0.0))
    least, greatest = bound.strain_energy
    force = float(np.dot(table["weight"], table["pressure"]))
    return Row(
        name, degree, n, solution.model.dofs, true / size, bound.error / size, least, size**2 / 2, greatest, force
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/bounds_of_closed_forms"), help="folder (%(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in FIELDS:
        for degree in (1, 2):
            for n in COUNTS:
                rows.append(row := row_of(name, n, degree))
                print(
                    f"{name}, degree {degree}, {row.unknowns:6d} unknowns: error {row.true:.2e}, "
                    f"bound {row.bound:.2e}, ratio {row.ratio:.2f}; energy {row.energy:.8f} in "
                    f"[{row.least_energy:.8f}, {row.greatest_energy:.8f}]; force {row.force:.6f}",
                    flush=True,
                )
                table = [vars(one) | {"ratio": one.ratio} for one in rows]
                write_csv(options.out / "bounds_of_closed_forms.csv", table)


if __name__ == "__main__":
    main()
