"""The effects: of each its keys, its form, and what is said of it; ``statement.effect.ENTRIES`` has the file of each.

A file is imported when a scene names one of its keys, and may import ``ufl`` within its methods only.  Boundaries and
quadrature come to it as arguments: it knows no mesh, no matrix and no result.  ``loads.load_vectors`` makes load
vectors of densities.
"""
