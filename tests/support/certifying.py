"""The certificate of any claim, from the scene, its mesh, a displacement and tractions alone."""

from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import Timings
from signorini_fx.results.certificate.contact_nodes import UNREGULARISED
from signorini_fx.results.mechanics import StatedMechanics


def certify(
    statement, tagged, displacement, tractions, *, law=UNREGULARISED, step=0, before=None, rigid=()
):
    """Of a load step."""
    model = prepare(statement, tagged, Timings(), path_step=step)
    mechanics = StatedMechanics(model, model.statement)
    return mechanics.certified(
        displacement, tractions, law=law, step=step, last=before, rigid=rigid
    )
