"""The machine under the package: how it was started, what it has, its terminal and its compiler.

These modules know no scene, no mesh and no PETSc object.
"""
