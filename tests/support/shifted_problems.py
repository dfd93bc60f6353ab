"""Regularised problems with shifts, at points that may open and move, whose slip counts from
zero.
"""

import numpy as np

from signorini_fx.algebra.contact.complementarity import RegularisedData


def shifted(gap, gamma_n, gamma_t, sigma, lambda_hat, mu_hat, bound, **more):
    """For the arguments see ``RegularisedData``."""
    none, origin = np.zeros(gap.shape, dtype=bool), np.zeros_like(mu_hat)
    return RegularisedData(
        gap, gamma_n, gamma_t, sigma, lambda_hat, mu_hat, bound, none, none, origin, **more
    )
