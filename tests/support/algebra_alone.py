"""A program of its own: Example 1 from matrices that numpy assembles, solved by the core without
dolfinx or UFL.

python3 tests/support/algebra_alone.py KIND ALGORITHM given|coefficient VALUE FILE.npz
"""

import sys
from itertools import product

import numpy as np
import scipy.sparse as sp

LENGTH, HEIGHT, NX, NY, YOUNG, POISSON, GAMMA = 3.0, 1.0, 24, 8, 5000.0, 0.4, 1e6


def stiffness_of_a_cell(width, height):
    """Of a bilinear rectangle in plane strain, corners in the order (0, 0), (1, 0), (0, 1), (1, 1),
    shape (8, 8).
    """
    mu = YOUNG / (2 * (1 + POISSON))
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    law = np.array([[lame + 2 * mu, lame, 0], [lame, lame + 2 * mu, 0], [0, 0, mu]])
    found = np.zeros((8, 8))
    for s, t in product((0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)), repeat=2):
        by_x = np.array([t - 1, 1 - t, -t, t]) / width
        by_y = np.array([s - 1, -s, 1 - s, s]) / height
        strain = np.zeros((3, 8))
        strain[0, 0::2], strain[1, 1::2] = by_x, by_y
        strain[2, 0::2], strain[2, 1::2] = by_y, by_x
        found += strain.T @ law @ strain * (width * height / 4)
    return found


def matrices():
    """K, f, B, w and the gap of Example 1, the prescribed unknowns, and the rigid motion that is
    free.
    """
    width, height = LENGTH / NX, HEIGHT / NY
    number = np.arange((NX + 1) * (NY + 1)).reshape(NY + 1, NX + 1)
    cells = np.stack(
        (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]), axis=-1
    ).reshape(-1, 4)
    unknowns = (2 * cells[:, :, None] + np.arange(2)).reshape(-1, 8)
    rows, columns = np.repeat(unknowns, 8, axis=1).ravel(), np.tile(unknowns, 8).ravel()
    values = np.tile(stiffness_of_a_cell(width, height).ravel(), len(cells))
    stiffness = sp.csr_array((values, (rows, columns)))
    load, x = np.zeros(2 * number.size), np.linspace(0.0, LENGTH, NX + 1)
    for k in range(NX):
        if 1.0 <= (x[k] + x[k + 1]) / 2 <= 2.0:
            load[2 * number[-1, [k, k + 1]] + 1] += -20.0 * width / 2
    bottom = number[0]
    count = bottom.size
    pairs = np.arange(2 * count), np.stack((2 * bottom + 1, 2 * bottom), axis=1).ravel()
    operator = sp.csr_array((np.tile([-1.0, 1.0], count), pairs), shape=(2 * count, load.size))
    weight = np.full(count, width)
    weight[[0, -1]] /= 2
    held = 2 * np.concatenate((number[:, 0], number[:, -1]))
    up = np.tile([0.0, 1.0], number.size)
    gap = 0.003 * (x - 1.5) ** 2 + 0.001
    return stiffness, load, operator, weight, gap, (held, np.zeros(held.size)), up[:, None]


def main(kind, algorithm, law, value, out):
    """Solve it, and store the state of the contact points from left to right."""
    from from_scipy import from_scipy, task_of

    from signorini_fx.algebra import Settings
    from signorini_fx.algebra.algorithms.strategy import solve_task
    from signorini_fx.algebra.contact.friction import PointFriction
    from signorini_fx.algebra.linalg import ElasticSystem
    from signorini_fx.algebra.linalg.condensed import CondensedSystem
    from signorini_fx.algebra.linalg.krylov import KrylovSystem

    stiffness, load, operator, weight, gap, prescribed, modes = matrices()
    elasticity, motions = from_scipy(
        stiffness, load, operator, weight, prescribed=prescribed, modes=modes
    )
    system = {"full": ElasticSystem, "condensed": CondensedSystem, "krylov": KrylovSystem}[kind].of(
        elasticity
    )
    none = np.zeros(weight.size)
    friction = PointFriction(**({"given": none, "coefficient": none} | {law: none + float(value)}))
    settings = Settings(algorithm=algorithm, tolerance=1e-11, gamma_n=GAMMA, gamma_t=GAMMA)
    task = task_of(system, motions, gap, friction, settings=settings)
    outcome = solve_task(task, task.start)
    state = task.contact(outcome, task.start)
    y = outcome.displacement().getArray(readonly=True) + modes @ task.rest.motion
    found = {name: getattr(state, name) for name in ("pressure", "shear", "u_n", "u_t")}
    np.savez(
        out, status=outcome.status.value, solves=task.history.linear_solves, top=y[-1], **found
    )
    strangers = {"dolfinx", "ufl", "basix", "pydantic"} & {
        name.partition(".")[0] for name in sys.modules
    }
    assert not strangers, strangers


if __name__ == "__main__":
    main(*sys.argv[1:])
