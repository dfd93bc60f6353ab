"""The machine: the launcher, the requirements, the terminal and the compiler.

These modules do not know scenes, meshes or PETSc objects.
"""
