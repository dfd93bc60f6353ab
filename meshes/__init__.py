"""Mesh generators.

A generator is a function ``generate(comm, /, *, ...) -> TaggedMesh``; its keyword arguments are the ``mesh.parameters``
of a scene.  Those of this package are the functions of this name in its modules; other installed packages add theirs as
entry points of the group ``signorini_fx.generators``.  The decorator ``generator`` says what a nested iteration and
adaptive refinement need to know.  Outlines and solids that several of them draw are in ``mesh.drawing``.

Bodies in 3D have the axis x[2] upwards and the foundation below.
"""

from signorini_fx.mechanics.statement.generators import Count, Length, generator, refuse, refuse_too_large

__all__ = ["Count", "Length", "generator", "refuse", "refuse_too_large"]
