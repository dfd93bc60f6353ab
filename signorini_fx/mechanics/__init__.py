"""Mechanics: what acts on bodies, and the matrices and loads that it makes.

A ``statement`` says what acts; kinematics, materials, friction laws, shapes of foundations and
other effects are a file each; ``mesh`` has the cells, ``pairs`` couple two surfaces, and ``body``
assembles.  The record of all that is a ``Model``.  This layer must not know how contact problems
are solved, nor where a problem comes from.
"""
