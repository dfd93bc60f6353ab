"""The quantities of this package, in the order in which a terminal shows them."""

# Files of this folder; each has QUANTITIES.
FAMILIES = (
    *("friction_used", "contact_nodes", "forces", "pressures", "zones", "moments", "displacements"),
    *("contact_boundaries", "tools", "sections", "resultants", "energies", "stress", "deformation", "law"),
    *("certificate", "proofs", "cost"),
)
