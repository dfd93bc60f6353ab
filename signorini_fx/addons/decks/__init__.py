"""Abaqus and CalculiX input files as scenes: what their keywords say, step by step, and what a scene cannot say.

No other package imports it: an add-on.  The mesh of such a file is read by ``mesh.files.abaqus``.
"""
