"""Input files of Abaqus and CalculiX: their meshes, and scenes drafted from them keyword by
keyword; and displacements that other programs have written.

No other package imports it: an add-on.
"""
