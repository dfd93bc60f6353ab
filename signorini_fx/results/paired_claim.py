"""What the solver says of a pair of bodies, for the certificate, which tries it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.body.paired_points import PairedSides
from signorini_fx.results.paired_sides import Claim


def claim_of(pair: PairedSides, space: fem.FunctionSpace) -> Claim:
    """What the solver says of a pair, with all nodes of the space as columns."""
    found, dim = pair.coupling, space.mesh.geometry.dim
    nodes = np.arange(len(space.tabulate_dof_coordinates()))
    own, others = (
        sp.csr_array(shares @ side.columns(nodes))
        for shares, side in ((found.slave, pair.slave), (found.master, pair.master))
    )
    turning = found.turning @ sp.kron(pair.master.columns(nodes), sp.eye_array(dim))
    return Claim(
        pair.slave.facets,
        pair.master.facets,
        pair.slave.nodes[found.nodes],
        found.weight,
        found.distance,
        own,
        others,
        sp.csr_array(sp.kron(own - others, sp.eye_array(dim)) + turning),
        found.alone,
        float(found.overlap.weight.sum()),
        found.hats,
        found.reach,
    )
