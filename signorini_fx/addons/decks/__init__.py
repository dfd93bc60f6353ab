"""Input files of Abaqus and CalculiX: their meshes, scenes drafted from them keyword by keyword,
and displacements that other programs have written.

It is an add-on: no other package imports it.
"""
