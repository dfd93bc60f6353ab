"""What the solver says of a pair of bodies, for the certificate, which tries it."""

from __future__ import annotations

import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.body.paired_points import PairedSides
from signorini_fx.results.paired_sides import Claim, Indices


def claim_of(
    pair: PairedSides, space: fem.FunctionSpace, slave: Indices, master: Indices, reach: float | None = None
) -> Claim:
    """What the solver says of a pair on this rank, whose sides are these facets according to the problem, with partners
    up to this distance; None: up to the usual one.
    """
    found, (own, others, turning) = pair.coupling, pair.shares()
    return Claim(
        space.mesh.comm,
        slave,
        master,
        (pair.slave.facets, pair.master.facets),
        pair.slave.nodes[found.nodes] - space.dofmap.index_map.local_range[0],
        found.weight,
        found.distance,
        pair.reached,
        own,
        others,
        sp.csr_array(sp.kron(own - others, sp.eye_array(found.distance.shape[1])) + turning),
        found.alone,
        found.covered,
        found.hats,
        found.reach,
        reach,
        pair.across,
        pair.planes,
    )
