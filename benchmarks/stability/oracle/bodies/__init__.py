"""Scenes of two and three deformable bodies, in 2D and in 3D, and contact between them."""
