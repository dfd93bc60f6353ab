"""Distributed meshes with named boundaries and regions, their refinement, and the contents of mesh
files.

This package knows dolfinx meshes, the generators of ``meshes/`` and the formats in ``files/``.  It
must not know unknowns, materials or contact.
"""
