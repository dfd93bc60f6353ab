"""Contact between two deformable bodies whose meshes do not match: search, overlap, dual functions,
coupling.

It needs no meshes or spaces of dolfinx.  Both surfaces are taken in the undeformed configuration.
The *slave* side carries the contact points; the other one is the *master*.

On several ranks both surfaces, and nothing else of the bodies, are on every rank: each pairs an
equal part of the facets of the slave, whichever rank has their cells, and keeps the rows of its own
points.
"""
