"""Mesh files of other programs as plain arrays, and back.

These modules know formats and names.  They must not know what a scene does with a mesh.
"""
