"""The materials: the stress of a strain, the bounds of the moduli, and what strains without stress.

``protocol`` documents them, ``effects.material`` finds them by their keys; none knows who asks it.
"""
