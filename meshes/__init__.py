"""Mesh generators.  Each module has ``generate(comm, *, ...) -> TaggedMesh``; its keyword arguments are the
``mesh.parameters`` of a scene.
"""
