"""Scenes of two and three deformable bodies, in the plane and in space, and contact between them."""
