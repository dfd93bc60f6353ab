"""Mechanics: what acts on bodies, and the matrices and loads that it makes.

A ``statement`` lists what acts.  Kinematics, materials, friction laws, shapes of foundations and
other effects have a file each; ``mesh`` has the cells, ``pairs`` couples two surfaces, and ``body``
assembles.  The result is a ``Model``.  This package depends neither on the solvers of contact
problems nor on the source of a problem.
"""
