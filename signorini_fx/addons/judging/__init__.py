"""A verdict on another program's contact result: equilibrium, supports, contact, friction, and the
distance to ours.

It shares nothing with the solver but the mesh and the data of the problem.  No other package
imports it: an add-on.
"""
