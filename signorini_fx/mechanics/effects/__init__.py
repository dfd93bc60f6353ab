"""The effects: of each its keys, its form, and what is said of it; ``scenes.scene.Scene`` has their
keys.

A file may import ``ufl`` within its methods only.  It knows no mesh, no matrix and no result:
``loads.load_vectors`` makes load vectors of densities.
"""
