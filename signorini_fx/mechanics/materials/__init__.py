"""The materials, one file each: the stress of a strain, the bounds of the moduli, and what strains without stress.

A material says its stress as UFL or as a matrix for the solver, and once more in NumPy for the certificate, in the same
file.  ``protocol`` documents it, ``directed`` has the axes of materials whose stress depends on the direction,
``registry`` finds materials by their keys, those of other packages by the entry points ``signorini_fx.materials``.

No material knows who asks it: neither meshes nor elements nor forms of one's own.
"""
