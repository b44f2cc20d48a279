"""Cramer-Rao bounds in per cent of the parameters, as flight tests report them.

The bound is the standard error that no unbiased estimate can be below if the residuals are white noise
(Maine & Iliff 1986). Residuals of flights are not, so that the interval next to it, which knows that, is the
one to rely on; a small bound with a wide interval says that the model's form limits the fit, not the noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.parameters import SearchSpace
from morphcore.identify.uncertainty import Uncertainty

Array = NDArray[np.float64]

PROBE = 1e-6  # in search coordinates: the transforms are smooth


def cramer_rao_percent(space: SearchSpace, x: Array, certainty: Uncertainty) -> dict[str, float | None]:
    """The bound of each searched parameter at a search point, in per cent of its size.

    Parameters
    ----------
    space : SearchSpace
    x : ndarray, shape (d,)
    certainty : Uncertainty
        With the singular values of the Jacobian there and the size of the residuals.

    Returns
    -------
    dict
        None where the value is 0, or the samples do not see the parameter at all.
    """
    named = space.flatten(space.decode(np.concatenate([x[None, :], x + PROBE * np.eye(x.size)])))
    slope = (named[1:] - named[0]).T / PROBE
    singular = certainty.singular_values
    floor = np.finfo(float).eps * max(float(singular.max(initial=0.0)), np.finfo(float).tiny) * x.size
    spread = np.where(singular > floor, certainty.noise_rad / np.maximum(singular, floor), np.inf)
    seen = slope @ certainty.directions.T  # (m, d) of each parameter along the directions
    with np.errstate(invalid="ignore"):
        error = np.sqrt(np.sum(np.where(seen == 0.0, 0.0, seen * spread) ** 2, axis=1))
    return {
        name: 100.0 * float(own / abs(value)) if np.isfinite(own) and value != 0.0 else None
        for name, own, value, searched in zip(
            space.parameter_names, error, named[0], space.searched, strict=True
        )
        if searched
    }
