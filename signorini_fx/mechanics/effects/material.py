"""What the body is made of, see ``materials``."""

from __future__ import annotations

from signorini_fx.mechanics.materials.registry import OneMaterial, every_material

Entry, every_entry = OneMaterial, every_material
