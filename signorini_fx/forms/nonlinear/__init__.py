"""Contact of nonlinear bodies: any residual in UFL, shapes at finite displacements, load steps of
automatic size.

``problem`` has the public class, ``steps`` the load steps, ``newton`` Newton's method within one
step, ``linearised`` the contact problem of an iteration, ``results`` the check of a solution
against the residual itself.
"""
