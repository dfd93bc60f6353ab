"""Distributed meshes with named boundaries and regions, their refinement, and the contents of mesh
files.

This package uses dolfinx meshes, the generators of ``meshes/`` and the formats in ``files/``.  It
must not depend on unknowns, materials or contact.
"""
