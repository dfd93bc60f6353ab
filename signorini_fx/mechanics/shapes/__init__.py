"""One file per rigid foundation that is a thing: its keys, its signed distance and its normal.

A file has the name of its shape in a scene, and ``Entry``, the class; ``statement.rigid_shape`` finds it there, and it
is imported when a scene names it.
"""
