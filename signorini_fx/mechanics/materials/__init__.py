"""The materials: the stress of a strain, the bounds of the moduli, and what strains without stress.

``protocol`` documents them, ``directed`` has the axes of materials whose stress depends on the direction,
``effects.material`` finds materials by their keys, those of other packages by their entry points.

No material knows who asks it: neither meshes nor elements nor forms of one's own.
"""
