"""Contact of nonlinear bodies: any residual in UFL, shapes at finite displacements, load steps of automatic size.

``problem`` has the public class, ``load_continuation`` the way through load steps, ``newton`` one step, ``linearised``
the contact problem of an iteration, ``results`` with the check of a solution against the residual itself.
"""
