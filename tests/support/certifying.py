"""The certificate of any claim, from the scene, its mesh, a displacement and tractions alone."""

from dataclasses import replace

from signorini_fx.results.certificate.certificate import balance_of, judged
from signorini_fx.results.certificate.contact_sides import sides_of
from signorini_fx.results.certificate.law_of_method import UNREGULARISED, overclosures_of
from signorini_fx.results.certificate.nodal_forces import NodalForces


def certify(
    statement, tagged, displacement, tractions, *, law=UNREGULARISED, step=0, before=None, pairs=None, rigid=()
):
    """Bodies in contact are paired anew without ``pairs``."""
    forces = NodalForces(statement, tagged, displacement.function_space)
    balance, sides = balance_of(forces, displacement, step), sides_of(forces, pairs)
    law = replace(law, overclosures=overclosures_of(statement))
    drives = [*zip(rigid, statement.drives(tagged.dimension, step), strict=bool(rigid))]
    return judged(displacement, balance, sides, tractions, law=law, before=before, rigid=drives)
