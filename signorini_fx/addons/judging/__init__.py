"""A verdict on a contact result of another program: equilibrium, supports, contact, friction, and
the distance to our solution.

It shares nothing with the solver except the mesh and the data of the problem.  It is an add-on: no
other package imports it.
"""
