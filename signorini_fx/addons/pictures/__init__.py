"""Pictures of a result: matplotlib in 2D and for curves, PyVista for bodies in 3D.

Its functions are given plain arrays and are called on one rank.  It must not import dolfinx or know where the arrays
come from; what is not everywhere, PyVista, is imported by the process that draws with it.
"""
