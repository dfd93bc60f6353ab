"""Contact between two deformable bodies whose meshes do not match: search, overlap, dual functions, coupling.

It needs NumPy alone, and neither meshes nor spaces of dolfinx.  Both surfaces are taken in the undeformed
configuration.  The *slave* side carries the contact points; the other one is the *master*.
"""
