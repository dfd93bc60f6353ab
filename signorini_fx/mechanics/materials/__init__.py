"""The materials: the stress of a strain, the bounds of the moduli, and what strains without stress.

``protocol`` documents them, ``effects.material`` finds them by their keys, those of other packages by entry points.

No material knows who asks it: neither meshes nor elements nor forms of one's own.
"""
