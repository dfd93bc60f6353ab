"""The shapes of rigid foundations: their keys, signed distances and normals.

``statement.rigid_shape`` maps each shape to its file, which is imported when a scene names the
shape.
"""
