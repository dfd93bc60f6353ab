"""Contact of nonlinear bodies: any residual in UFL, shapes at finite displacements, load steps of
automatic size.

``problem`` has the public class, ``newton`` one step and the way through load steps, ``linearised``
the contact problem of an iteration, ``results`` with the check of a solution against the residual
itself.
"""
