"""The method: contact problems given by matrices, and the algorithms that solve them.

Contact laws at points, the regularised problem and its active sets, outer algorithms, and linear algebra.  This layer
sees matrices and values at contact points.  It must not know forms, meshes, materials or scenes.
"""
