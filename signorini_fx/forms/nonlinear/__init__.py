"""Contact of nonlinear bodies: any residual in UFL, shapes at finite displacements, load steps of automatic size.

``problem`` has the public class, ``newton`` Newton's method for one step, ``load_continuation`` the way through load
steps, ``linearised`` the contact problem of an iteration, ``residual`` what F is at a displacement, ``moving_shapes``
distances and normals at displaced points, ``displaced_certificate`` the check of a solution against the residual
itself, ``inertia`` that of the tangent, ``penetration`` whether a shape is inside the body, ``outcomes`` how all of it
ends.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
