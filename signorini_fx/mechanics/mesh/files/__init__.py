"""Mesh files of other programs as plain arrays, and back.

These modules deal with formats and names only, not with the use of a mesh in a scene.
"""
