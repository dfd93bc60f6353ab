"""The materials: the stress of a strain, bounds of the moduli, and internal variables.

``protocol`` documents the interface, and ``effects.material`` finds a material by its keys.
"""
