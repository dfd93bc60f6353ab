"""Two curved bodies pressed together: what is known of them without a solver, and what the solver says.

Mirror-equal bodies meet in the plane of symmetry between them: the force is that of one of them on a rigid plane, and
as nothing moves along that plane relative to the other side, friction has nothing to take.  So the shear, as a share of
F P, and the difference of the forces are errors, of the frames and of the discretisation.

    ./env python3 tests/support/curved_pairs.py mirrored | unmatched | circle | steps

mirrored: equal bodies at a/R of .036, .075 and .144, points on either side, and spheres at .2, refined.  unmatched:
spheres whose meshes do not match, refined, and flat sides with the same gap as a formula.  circle: Cattaneo's and
Mindlin's problem, a block on a rigid circle, by the frame of the body, of the circle, half-way, and of a pair whose
round side is held.  steps: what sticks after pressing in 1, 5 and 40 steps.
"""

import sys
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held, per_cell

from signorini_fx import ContactProblem, Coulomb, Foundation, Pair, solve, tag_boundaries
from signorini_fx.scenes.reading import parse_scene

SIZE = 3.0


class Pressed(NamedTuple):
    """Attributes: force; shear, the sum of its magnitudes; share, of F P; a, half the width of contact."""

    force: float
    shear: float
    share: float
    a: float


def cap(kind, radius, sign, cells, power=1.7):
    """A body on -3 <= x <= 3 (in 3D |x|, |y| <= 3) with a rounded face at the origin.

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
    poisson=0.3,
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
        poisson: of both.
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
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: young[0] if x[up] > 0 else young[1]), poisson)
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
    """Attributes: ratio, a/R from the moments of the pressure; share, of F P after pressing; push, Q over F P; off, the
    difference of the horizontal traction from Cattaneo's and Mindlin's in L2.
    """

    ratio: float
    share: float
    push: float
    off: float


def foundation_of(frame, radius):
    """A circle below the origin by its shape, by the body's vertical normal, or half-way between both normals."""
    centre = np.array([0.0, -radius])

    def away(x):
        return x[:2] - centre[:, None]

    def half_way(x):
        direction = -away(x) / np.hypot.reduce(away(x)) - [[0.0], [1.0]]
        return direction / np.hypot.reduce(direction)

    def along(x):
        arm, way = away(x), -(away(x) * half_way(x)).sum(axis=0)
        return way - np.sqrt(np.maximum(radius**2 - (arm**2).sum(axis=0) + way**2, 0.0))

    return {
        "circle": {"shape": {"shape": "circle", "centre": tuple(centre), "radius": radius}},
        "half-way": {"gap": along, "direction": half_way},
        "body": {
            "gap": lambda x: radius - np.sqrt(np.maximum(radius**2 - x[0] ** 2, 0.0)),
            "direction": (0.0, -1.0),
        },
    }[frame]


def pressed_block(frame, friction, *, radius=8.0, cells=(40, 18), size=24.0, poisson=0.49):
    """A block of quadrilaterals of degree 2 on a circle: (motion of its top along, downwards) -> the solved problem."""
    (along, through), kind = cells, "quadrilateral"

    def place(x):
        return size * np.column_stack((np.sign(x[:, 0]) * np.abs(x[:, 0]) ** 2.6, x[:, 1] ** 2.4))

    def round_strip(x):
        angle, away = np.pi / 8 * np.sign(x[:, 0]) * np.abs(x[:, 0]) ** 1.6, radius - 0.5 + 0.5 * x[:, 1]
        return np.column_stack((away * np.sin(angle), away * np.cos(angle) - radius))

    pieces = [grid(kind, (2 * along, through), (-1.0, 0.0), (1.0, 1.0), place)]
    if frame == "held pair":
        pieces.append(grid(kind, (4 * along, 2), (-1.0, 0.0), (1.0, 1.0), round_strip))
    mesh = assembled(kind, *pieces)
    space, a, v = forms(mesh, 2, 200.0, poisson)
    moved = fem.Function(space)
    top = fem.locate_dofs_topological(space, 1, facets(mesh, lambda x: np.isclose(x[1], size)))
    side = facets_of_piece(mesh, lambda x: np.isclose(x[1], 0.0), lambda x: x[1] > 0)
    bcs = [fem.dirichletbc(moved, top)]
    if frame == "held pair":
        arc = facets_of_piece(mesh, lambda x: np.isclose(np.hypot(x[0], x[1] + radius), radius), lambda x: x[1] < 0)
        mesh.topology.create_connectivity(2, 2)
        strip = fem.locate_dofs_topological(space, 2, dmesh.locate_entities(mesh, 2, lambda x: x[1] < 1e-9))
        bcs.append(fem.dirichletbc(np.zeros(2), strip, space))
        against = Pair(side, arc, friction=Coulomb(friction))
    else:
        against = Foundation(side, friction=Coulomb(friction), **foundation_of(frame, radius))
    nothing = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx
    problem = ContactProblem(a, nothing, bcs, contact=against, algorithm="alm", tolerance=1e-8)

    def solved(sideways, down):
        moved.interpolate(lambda x: np.vstack((0 * x[0] + sideways, 0 * x[0] - down)))
        problem.solve()
        return problem

    return solved


def pushed(frame, depth, *, radius=8.0, friction=0.3, steps=1, **given):
    """Press a block onto a circle, see ``pressed_block``, in one step or several, and push it; see ``Rigid``."""
    moved = pressed_block(frame, friction, radius=radius, **given)

    def figures_of(problem):
        state = problem.state
        w, x, tangent = state.boundary.weight, state.boundary.x[:, 0], state.boundary.tangents[:, :, 0]
        traction = state.pressure[:, None] * state.boundary.normal + state.shear[:, :1] * tangent
        middle = w @ (state.pressure * x) / (w @ state.pressure)
        half = 2 * np.sqrt(w @ (state.pressure * (x - middle) ** 2) / (w @ state.pressure))
        return state, w, x - middle, traction[:, 0], np.abs(w @ traction), half

    for k in range(1, steps + 1):
        problem = moved(0.0, depth * k / steps)
        state, w, _, _, force, _ = figures_of(problem)
        problem.advance()
    share = float(w @ np.abs(state.shear[:, 0]) / (friction * force[1]))
    _, w, x, along_x, force, half = figures_of(moved(friction * depth, depth))
    push = force[0] / (friction * force[1])
    inner, largest = half * np.sqrt(1 - push), friction * 2 * force[1] / (np.pi * half)
    theory = largest * np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0))
    theory -= largest * inner / half * np.sqrt(np.maximum(1 - (x / inner) ** 2, 0.0))
    off = np.sqrt(w @ (np.sign(w @ along_x) * along_x - theory) ** 2 / (w @ theory**2))
    return Rigid(half / radius, share, float(push), float(off))


def circle():
    """Print the table of ``pushed``."""
    print(f"{'a/R':>6} {'F':>4} {'steps':>5} {'frame':>9} {'Q/FP':>6} {'pressing':>9} {'off in L2':>9}")
    for depth, friction, steps in ((0.03, 0.3, 1), (0.1, 0.3, 1), (0.1, 0.3, 5), (0.1, 0.6, 1), (0.3, 0.3, 1)):
        for frame in ("body", "circle", "half-way", "held pair"):
            found = pushed(frame, depth, friction=friction, steps=steps)
            print(
                f"{found.ratio:6.3f} {friction:4.1f} {steps:5} {frame:>9} {found.push:6.3f} {100 * found.share:8.2f}% "
                f"{100 * found.off:8.2f}%",
                flush=True,
            )


def pressed_in(count, hypothesis, cells=96):
    """Press a block onto a circle of radius 8, or one of revolution onto a sphere, in some steps: a/R, and the half
    width that sticks over a, both to a facet.
    """
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], [1.0, 1.0]], [cells, 24], dmesh.CellType.quadrilateral)
    mesh.geometry.x[:] = 16.0 * (0.06 * mesh.geometry.x + 0.94 * mesh.geometry.x**4)
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
        for cells in (96, 192):
            for count in (1, 5, 40):
                ratio, stick = pressed_in(count, hypothesis, cells)
                print(f"{what:>8} {cells:5} {count:5} {ratio:6.3f} {stick:12.3f}", flush=True)


def _row(words, found):
    force, share, ratio = found
    print(f"{words:>28} {ratio:6.3f} {100 * force:9.4f}% {100 * share:9.4f}%", flush=True)


def mirrored_table():
    """Print force and shear of equal bodies, points on either side, on meshes that match and do not, and of spheres."""
    print(f"{'cells, points':>28} {'a/R':>6} {'force':>10} {'share':>10}")
    for depth in (0.035, 0.11, 0.32):
        for coarse, other, slave in ((20, 20, 0), (40, 40, 0), (40, 40, 1), (40, 30, 0), (40, 30, 1)):
            cells = ((coarse, 24), (other, 24))
            _row(f"{cells} {slave}", mirrored("quadrilateral", cells, 8.0, depth, slave=slave))
    for count in (4, 6, 8, 10):
        cells = ((count, count),) * 2
        _row(f"{cells}", mirrored("hexahedron", cells, 8.0, 0.6))


def unmatched():
    """Print the same of spheres whose meshes do not match, refined, and of flat sides with the same gap."""
    print(f"{'cells, points':>28} {'a/R':>6} {'force':>10} {'share':>10}")
    for count in (4, 8, 12):
        cells = ((count, count), (round(0.75 * count), count))
        for flat, slave in ((False, 0), (False, 1), (True, 0), (True, 1)):
            words = f"{('curved', 'flat')[flat]} {cells} {slave}"
            _row(words, mirrored("hexahedron", cells, 8.0, 0.6, slave=slave, flat=flat))


TABLES = {"circle": circle, "steps": steps, "mirrored": mirrored_table, "unmatched": unmatched}

if __name__ == "__main__":
    TABLES[sys.argv[1]]()
