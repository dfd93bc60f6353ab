"""Pictures of a solution: matplotlib in 2D and for curves, PyVista for bodies in 3D.

``results`` and ``of_setup`` gather plain arrays from all ranks; the others draw them on the first one, and do not know
where they come from.  What is not everywhere, PyVista, is imported by the process that draws with it.
"""
