"""Pictures of a solution: matplotlib in 2D and for curves, PyVista for bodies in 3D.

``gather``, ``rigid_shapes`` and ``of_setup`` gather from all ranks what is drawn on the first one.
What is not everywhere, PyVista, is imported by the process that draws with it.
"""
