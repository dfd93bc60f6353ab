"""Stresses in equilibrium with forces in a tetrahedron, without tractions on its faces: they prove the constants of
``korn.HILL``.
"""

import numpy as np

from signorini_fx.addons.bounds.korn import hill
from signorini_fx.addons.bounds.lifted_forces import Quarters, mass_of_nodes
from signorini_fx.addons.bounds.lifted_tractions import divided_face
from signorini_fx.addons.bounds.simplices import TWICE


def largest_norm(cosine, m):
    """The largest norm, per that of the force, of the least stress of ``Quarters`` in equilibrium with forces that are
    linear on the m^3 parts of the tetrahedron of ``hill`` and orthogonal to linear vectors in it; and how far stresses
    miss equilibrium, relative."""
    face, count = divided_face(m), m**3
    cells = Quarters.of(face.x @ hill(cosine), face.corners)
    quarters = len(cells.corners)
    volume = abs(np.linalg.det(np.diff(hill(cosine), axis=0))) / 6 / quarters  # of a quarter
    # Stresses and forces in orthonormal bases.
    unit = np.kron(np.linalg.inv(np.linalg.cholesky(volume * mass_of_nodes()).T), np.diag(1 / np.sqrt(TWICE[3])))
    matrix = np.concatenate((cells.tractions, cells.divergence))
    matrix = (matrix.reshape(len(matrix), quarters, 60) @ unit).reshape(len(matrix), -1)
    mass = 4 * volume * (np.ones((4, 4)) + np.eye(4)) / 20
    root = np.kron(np.eye(count), np.kron(np.linalg.cholesky(mass).T, np.eye(3)))
    linear = root @ np.kron(face.x[face.corners].reshape(-1, 4), np.eye(3))
    orthogonal = np.linalg.solve(root, np.linalg.qr(linear, mode="complete")[0][:, linear.shape[1] :])
    of_corners = np.zeros((quarters, 4, count, 4))
    for quarter, vertices in enumerate(cells.corners):
        own = face.corners[quarter // 4]
        of_corners[quarter, :, quarter // 4] = [
            own == vertex if vertex in own else np.full(4, 0.25) for vertex in vertices
        ]
    given = -np.kron(of_corners.reshape(4 * quarters, -1), np.eye(3)) @ orthogonal
    given = np.concatenate((np.zeros((len(cells.tractions), given.shape[1])), given))
    stresses = np.linalg.lstsq(matrix, given, rcond=1e-10)[0]
    missed = np.linalg.norm(matrix @ stresses - given) / np.linalg.norm(given)
    return float(np.linalg.norm(stresses, 2)), float(missed)
