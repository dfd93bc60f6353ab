"""One file per effect: its keys, its form, its share in the independent check, and what is said of it.

A file has the name of its key in a scene, and ``Entry``, the type of an entry; ``statement.effect`` finds it there.  It
is imported when a scene names the key, and may import ``ufl`` within its methods only.  Boundaries and quadrature come
to it as arguments: it knows no mesh, no matrix and no result.  ``loads.load_vectors`` makes load vectors of densities.
"""
