"""Two curved bodies pressed together: what is known of them without a solver, and what the solver says.

Mirror-equal bodies meet in the plane of symmetry between them: the force is that of one of them on a rigid plane, and
as nothing moves along that plane relative to the other side, friction has nothing to take.  So the shear, as a share of
F P, and the difference of the forces are errors, of the frames and of the discretisation.

    ./env python3 tests/curved_pairs.py plane | space | mirrored | unmatched | circle | steps

mirrored: equal bodies at a/R of .036, .075 and .144, points on either side.  unmatched: spheres whose meshes do not
match, refined, and flat sides with the same gap as a formula.  circle: Cattaneo's and Mindlin's problem, a block on a
rigid circle, by the frame of the body, of the circle, and half-way.  steps: what sticks after pressing in 1, 5 and 40
steps.
"""

import sys
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held, per_cell

from signorini_fx import ContactProblem, Coulomb, Foundation, Pair

SIZE = 3.0


class Pressed(NamedTuple):
    """Attributes: force; shear, the sum of its magnitudes; share, of F P; a, half the width of contact."""

    force: float
    shear: float
    share: float
    a: float


def cap(kind, radius, sign, cells, power=1.7):
    """A body on -3 <= x <= 3 (in space |x|, |y| <= 3) with a rounded face at the origin.

    Args:
        kind: of the cells.
        radius: of the face, a paraboloid; infinite: flat.
        sign: +1 above the face, -1 below.
        cells: along the half width, and through the body.
        power: by which cells shrink towards the origin.
    """
    dim, (along, through) = KINDS[kind], cells

    def place(x):
        s, z = x[:, :-1], x[:, -1]
        wide = SIZE * np.sign(s) * np.abs(s) ** power
        face = (wide**2).sum(axis=1) / (2 * radius)
        return np.column_stack((wide, sign * (face + (SIZE - face) * z**1.3)))

    return grid(kind, (*[2 * along] * (dim - 1), through), (*[-1.0] * (dim - 1), 0.0), (1.0,) * dim, place)


def press(
    kind,
    cells,
    radii,
    depth,
    *,
    young=(200.0, 200.0),
    degree=1,
    slave=0,
    friction=0.3,
    push=0.0,
    contact=None,
    gap=None,
    **given,
):
    """Press two caps, or one on a rigid foundation, and solve; with a gap as a formula they are flat.

    Args:
        kind: of the cells.
        cells: of both caps, see ``cap``; of one alone: its foundation is rigid.
        radii: of both.
        depth: by which the upper one moves down.
        young: of both.
        degree: of the elements.
        slave: 0: the points are on the upper one.
        friction: F.
        push: by which the upper one moves along x.
        contact: facets -> the foundation of one alone; None: a plane through the origin.
        gap: of sides that are flat then, length; None: they are curved.
        given: settings.
    """
    up, alone = KINDS[kind] - 1, len(cells) == 1
    radii = radii if gap is None else (np.inf,) * len(radii)
    made = [cap(kind, r, s, n) for r, s, n in zip(radii, (1.0, -1.0), cells, strict=False)]
    mesh = assembled(kind, *made)
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: young[0] if x[up] > 0 else young[1]))
    sides = [
        facets_of_piece(
            mesh,
            lambda x, r=r, s=s: np.isclose(x[up], s * (x[:up] ** 2).sum(axis=0) / (2 * r)),
            lambda x, s=s: s * x[up] > 0,
        )
        for r, s in zip(radii, (1.0, -1.0), strict=False)
    ]
    ends = [facets(mesh, lambda x, z=z: np.isclose(x[up], z)) for z in (SIZE, -SIZE)]
    bcs = [held(space, ends[0], k, push if k == 0 else 0.0) for k in range(up)] + [held(space, ends[0], up, -depth)]
    law = Coulomb(friction) if friction else None
    if alone:
        made_contact = contact or (
            lambda side: Foundation(side, gap=gap or (lambda x: x[up]), direction=(*(0.0,) * up, -1.0), friction=law)
        )
        against = made_contact(sides[0])
    else:
        bcs += [held(space, ends[1], k) for k in range(up + 1)]
        against = Pair(sides[slave], sides[1 - slave], friction=law, gap=gap or "geometry")
    nothing = ufl.inner(fem.Constant(mesh, (0.0,) * (up + 1)), v) * ufl.dx
    problem = ContactProblem(a, nothing, bcs, contact=against, **{"algorithm": "alm", "tolerance": 1e-9} | given)
    problem.solve()
    return problem


def figures(problem, friction=0.3):
    """See ``Pressed``."""
    state, up = problem.state, problem.state.boundary.x.shape[1] - 1
    boundary = state.boundary
    force = abs(float(state.forces[0][up]))
    shear = float(boundary.weight @ np.linalg.norm(state.shear, axis=1))
    touching = boundary.x[state.pressure > 0]
    return Pressed(force, shear, shear / (friction * force), float(np.abs(touching[:, 0]).max()))


def mirrored(kind, cells, radius, depth, *, flat=False, **given):
    """(force of two equal bodies over that of one on a plane) - 1, the share, and a / R; ``flat``: with flat sides."""
    up = KINDS[kind] - 1
    gaps = [(lambda x, k=k: k * (x[:up] ** 2).sum(axis=0) / (2 * radius)) if flat else None for k in (1, 2)]
    one = figures(press(kind, cells[:1], (radius,), depth / 2, friction=0.0, gap=gaps[0], **given))
    two = figures(press(kind, cells, (radius, radius), depth, gap=gaps[1], **given))
    return two.force / one.force - 1.0, two.share, one.a / radius


# --- rigid circles and spheres ----------------------------------------------------------------------------------------


class Rigid(NamedTuple):
    """Attributes: ratio, a/R from the moments of the pressure; share, of F P after pressing; stick, half the width that
    sticks over a; push, Q over F P; off, the difference of the horizontal traction from Cattaneo's and Mindlin's in L2.
    """

    ratio: float
    share: float
    stick: float
    push: float
    off: float


def foundation_of(frame, radius, dim, friction):
    """A ball or a circle below the origin by a shape, by its own normal, or by the body's as a formula."""
    centre = np.append(np.zeros(dim - 1), -radius)

    def away(x):
        return x[:dim] - centre[:, None]

    return {
        "half-way": {"shape": {"shape": "circle" if dim == 2 else "sphere", "centre": tuple(centre), "radius": radius}},
        "circle": {"gap": lambda x: np.hypot.reduce(away(x)) - radius, "direction": lambda x: -away(x)},
        "body": {
            "gap": lambda x: radius - np.sqrt(np.maximum(radius**2 - (x[: dim - 1] ** 2).sum(axis=0), 0.0)),
            "direction": tuple(np.append(np.zeros(dim - 1), -1.0)),
        },
    }[frame]


def pushed(frame, depth, *, radius=8.0, friction=0.3, cells=(24, 12), steps=1, size=24.0, poisson=0.49):
    """Press a block of quadrilaterals of degree 2 onto a circle, in one step or several, and push it; see ``Rigid``."""
    (along, through), kind = cells, "quadrilateral"

    def place(x):
        return size * np.column_stack((np.sign(x[:, 0]) * np.abs(x[:, 0]) ** 2.6, x[:, 1] ** 2.4))

    mesh = assembled(kind, grid(kind, (2 * along, through), (-1.0, 0.0), (1.0, 1.0), place))
    space, a, v = forms(mesh, 2, 200.0, poisson)
    moved = fem.Function(space)
    top = fem.locate_dofs_topological(space, 1, facets(mesh, lambda x: np.isclose(x[1], size)))
    side = facets(mesh, lambda x: np.isclose(x[1], 0.0))
    against = Foundation(side, friction=Coulomb(friction), **foundation_of(frame, radius, 2, friction))
    nothing = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx
    problem = ContactProblem(
        a, nothing, [fem.dirichletbc(moved, top)], contact=against, algorithm="alm", tolerance=1e-8
    )

    def solved(sideways, down):
        moved.interpolate(lambda x: np.vstack((0 * x[0] + sideways, 0 * x[0] - down)))
        problem.solve()
        state = problem.state
        w, x, tangent = state.boundary.weight, state.boundary.x[:, 0], state.boundary.tangents[:, :, 0]
        traction = state.pressure[:, None] * state.boundary.normal + state.shear[:, :1] * tangent
        force = np.abs(w @ traction)
        middle = w @ (state.pressure * x) / (w @ state.pressure)
        half = 2 * np.sqrt(w @ (state.pressure * (x - middle) ** 2) / (w @ state.pressure))
        return state, w, x - middle, traction[:, 0], force, half

    for k in range(1, steps + 1):
        state, w, x, _, force, half = solved(0.0, depth * k / steps)
        problem.advance()
    share = float(w @ np.abs(state.shear[:, 0]) / (friction * force[1]))
    sticks = (state.pressure > 0) & (np.abs(state.shear[:, 0]) < friction * state.pressure * (1 - 1e-6))
    stick = np.abs(x[sticks]).max(initial=0.0) / half
    _, w, x, along_x, force, half = solved(friction * depth, depth)
    push = force[0] / (friction * force[1])
    inner, largest = half * np.sqrt(1 - push), friction * 2 * force[1] / (np.pi * half)
    theory = largest * np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0))
    theory -= largest * inner / half * np.sqrt(np.maximum(1 - (x / inner) ** 2, 0.0))
    off = np.sqrt(w @ (np.sign(w @ along_x) * along_x - theory) ** 2 / (w @ theory**2))
    return Rigid(half / radius, share, float(stick), float(push), float(off))


def circle():
    """Print the table of ``pushed``."""
    print(f"{'a/R':>6} {'F':>4} {'steps':>5} {'frame':>9} {'Q/FP':>6} {'pressing':>9} {'off in L2':>9}")
    for depth, friction, steps in ((0.03, 0.3, 1), (0.1, 0.3, 1), (0.1, 0.3, 5), (0.1, 0.6, 1), (0.3, 0.3, 1)):
        for frame in ("body", "circle", "half-way"):
            cells = (40, 18)
            found = pushed(frame, depth, friction=friction, steps=steps, cells=cells)
            print(
                f"{found.ratio:6.3f} {friction:4.1f} {steps:5} {frame:>9} {found.push:6.3f} {100 * found.share:8.2f}% "
                f"{100 * found.off:8.2f}%",
                flush=True,
            )


def main(what):
    """Print a table."""
    if what in OTHERS:
        OTHERS[what]()
        return
    kind, sizes, depths = {
        "plane": ("quadrilateral", ((14, 10), (28, 20), (56, 40)), (0.01, 0.05, 0.18)),
        "space": ("hexahedron", ((5, 5), (8, 7)), (0.1, 0.3)),
    }[what]
    print(f"{'cells':>24} {'a/R':>6} {'force':>10} {'share':>10}")
    for depth in depths:
        for n in sizes:
            for cells in ((n, n), (n, (round(n[0] * 0.75), n[1]))):
                for slave in (0, 1) if cells[0] != cells[1] else (0,):
                    force, share, ratio = mirrored(kind, cells, 8.0, depth, slave=slave)
                    print(f"{f'{cells} {slave}':>24} {ratio:6.3f} {100 * force:9.4f}% {100 * share:9.3f}%", flush=True)


def pressed_in(count, hypothesis, cells=48):
    """Press a block onto a circle of radius 8, or one of revolution onto a sphere, in some steps: a/R, and the half
    width that sticks over a, both to a facet.
    """
    from mpi4py import MPI

    from signorini_fx import solve, tag_boundaries
    from signorini_fx.scene.reading import parse_scene

    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF, [[0.0, 0.0], [1.0, 1.0]], [cells, cells // 2], dmesh.CellType.quadrilateral
    )
    mesh.geometry.x[:] = 16.0 * mesh.geometry.x**2.5
    tagged = tag_boundaries(
        mesh,
        {
            "bottom": lambda x: np.isclose(x[1], 0.0),
            "top": lambda x: np.isclose(x[1], 16.0),
            "axis": lambda x: np.isclose(x[0], 0.0),
        },
    )
    scene = {
        "mesh": tagged,
        "material": {"young": 200.0, "poisson": 0.3, "hypothesis": hypothesis},
        "displacement": [
            {"boundary": "top", "y": -0.03, "factors": [(k + 1) / count for k in range(count)]},
            {"boundary": "axis", "x": 0.0},
        ],
        "contact": {
            "boundary": "bottom",
            "foundation": {"shape": "circle", "centre": [0.0, -8.0], "radius": 8.0},
            "friction": {"law": "coulomb", "coefficient": 0.3},
        },
    }
    state = solve(parse_scene(scene)).contact
    x, touching = state.boundary.x[:, 0], state.pressure > 0
    sticks = touching & (np.abs(state.shear[:, 0]) < 0.99 * 0.3 * state.pressure)
    return x[touching].max() / 8.0, x[sticks].max(initial=0.0) / x[touching].max()


def steps():
    """Print what sticks after pressing without a push, by the number of steps."""
    print(f"{'':>8} {'cells':>5} {'steps':>5} {'a/R':>6} {'stick over a':>12}")
    for what, hypothesis in (("circle", "plane strain"), ("sphere", "axisymmetric")):
        for cells in (48, 96):
            for count in (1, 5, 40):
                ratio, stick = pressed_in(count, hypothesis, cells)
                print(f"{what:>8} {cells:5} {count:5} {ratio:6.3f} {stick:12.3f}", flush=True)


def mirrored_table():
    """Print force and shear of equal bodies in the plane, points on either side, on meshes that match and do not."""
    print(f"{'cells':>24} {'points':>6} {'a/R':>6} {'force':>10} {'share':>10}")
    for depth in (0.035, 0.11, 0.32):
        for other in (40, 30):
            for slave in (0, 1):
                cells = ((40, 24), (other, 24))
                force, share, ratio = mirrored("quadrilateral", cells, 8.0, depth, slave=slave)
                print(f"{f'{cells}':>24} {slave:6} {ratio:6.3f} {100 * force:9.4f}% {100 * share:9.4f}%", flush=True)


def unmatched():
    """Print the same of spheres whose meshes do not match, refined, and of flat sides with the same gap."""
    print(f"{'cells':>24} {'sides':>6} {'points':>6} {'a/R':>6} {'force':>10} {'share':>10}")
    for count in (4, 8, 12):
        cells = ((count, count), (round(0.75 * count), count))
        for flat, slave in ((False, 0), (False, 1), (True, 0), (True, 1)):
            force, share, ratio = mirrored("hexahedron", cells, 8.0, 0.6, slave=slave, flat=flat)
            words = f"{f'{cells}':>24} {('curved', 'flat')[flat]:>6} {slave:6} {ratio:6.3f}"
            print(f"{words} {100 * force:9.4f}% {100 * share:9.4f}%", flush=True)


OTHERS = {"circle": circle, "steps": steps, "mirrored": mirrored_table, "unmatched": unmatched}

if __name__ == "__main__":
    main(*sys.argv[1:])
