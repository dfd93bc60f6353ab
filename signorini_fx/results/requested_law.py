"""Whether the contact law of a result is the one that its settings ask for.

Where the method of a scene fails, another one is tried, and its solution may keep to another law: augmentation leaves
no regularisation where a gamma was given, and bodies that lie loose are solved with the regularised law.  The path in
gamma may end at the largest gamma before it reaches the error that was asked for.  All of these are solutions of the
law that the certificate names, and none of them is what was asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Finding
from signorini_fx.results.certificate.certificate import Certificate


def another_law(
    settings: SolverSettings,
    certificates: Mapping[int, Certificate],
    left: float | None,
    *,
    raises_gamma: bool = False,
) -> Finding | None:
    """A warning where the law of the load steps, by their numbers, is not the one that settings ask for; ``left``: the
    regularisation error of the last one relative to its energy norm, where a path in gamma has found it;
    ``raises_gamma``: whether an accuracy is asked for, which raises gamma as it needs to.
    """
    laws = {step: certificate.law for step, certificate in certificates.items()}
    if settings.algorithm == "alm":
        others = [step for step, law in laws.items() if law.regularised]
        if not others:
            return None
        worst = max((certificates[step] for step in others), key=lambda certificate: certificate.penetration)
        message = (
            f"'alm' was not reached{_where(laws, others)}, the regularised law with gamma_n = "
            f"{laws[others[-1]].gamma_n:.3g} was solved instead; it leaves penetration {worst.penetration:.1e} and "
            f"elastic slip {worst.stick_slip:.1e} times the largest displacement; raise solver.gamma_n and "
            "solver.gamma_t to lessen them, or change the loads in smaller steps"
        )
        return Finding("warning", "solver.algorithm", message)
    if raises_gamma:
        return None
    if settings.algorithm == "path-following":
        allowed = settings.regularisation_error
        if allowed == "auto" or left is None or left <= allowed:
            return None
        gamma = list(laws.values())[-1].gamma_n
        message = (
            f"a regularisation error of {allowed:.2g} was asked for and {left:.2g} is left; with a gamma above "
            f"{gamma:.3g} round-off would take over; take algorithm = 'alm', which leaves none"
        )
        return Finding("warning", "solver.regularisation_error", message)
    given = {name: value for name in ("gamma_n", "gamma_t") if (value := getattr(settings, name)) != "auto"}
    others = [step for step, law in laws.items() if any(getattr(law, name) != given[name] for name in given)]
    if not others:
        return None
    asked = ", ".join(f"{name} = {value:.3g}" for name, value in given.items())
    message = (
        f"{asked} was asked for, and a fall-back has solved {laws[others[-1]]} in its place{_where(laws, others)}; "
        "lower gamma, or set solver.fallbacks = false to have this gamma or nothing"
    )
    return Finding("warning", "solver.gamma_n", message)


def _where(steps: Iterable[int], others: list[int]) -> str:
    """In which load steps, if there are several."""
    if len([*steps]) == 1:
        return ""
    return f" in load step{'s' * (len(others) > 1)} {', '.join(map(str, others))}"
