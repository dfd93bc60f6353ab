"""Contact between two deformable bodies whose meshes do not match: search, overlap, dual functions,
coupling.

It needs no meshes or spaces of dolfinx.  Both surfaces are taken in the undeformed configuration.
The *slave* side carries the contact points; the other one is the *master*.

On several ranks both surfaces, and nothing else of the bodies, are on every rank: see ``Sharing``.
"""
