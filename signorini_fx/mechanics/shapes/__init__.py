"""The rigid foundations that are things: their keys, signed distances and normals.

``statement.rigid_shape`` knows the file of each, which is imported when a scene names the shape.
"""
