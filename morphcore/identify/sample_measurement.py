"""What an identification found out about the measurement of each sample, and the records of its residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.coloured import ColouredNoise, Record
from morphcore.identify.cost import SampleCase, reduced_errors, shared_trims
from morphcore.identify.free_start import free_parts
from morphcore.identify.measurement import DELAY_SPREAD_S, HEADING, START, angle_noise
from morphcore.identify.nuisance import PRIOR_RAD, linear_columns
from morphcore.models.equivalent import ParameterBatch
from morphcore.search.least_squares import probes
from morphcore.simulate.trim import Trim

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nuisances:
    """The fitted nuisances of one sample, at the best model.

    Attributes
    ----------
    names : tuple of str
        ``bias.phi``, ``start.q_rad_s``, ``delay``: of the n nuisances.
    value : ndarray, shape (n,)
        Of each, of readings: a bias adds to the truth.
    columns : ndarray, shape (k, c, n)
        Derivatives of the weighted residuals of the fitted channels.
    slope : ndarray, shape (n, d)
        Derivatives of the values by the search coordinates.
    prior : ndarray, shape (n,)
        Weights of their priors.
    spread : ndarray, shape (n,)
        Standard deviations of their priors; 0 where there is none.
    """

    names: tuple[str, ...]
    value: Array
    columns: Array
    slope: Array
    prior: Array
    spread: Array


def fitted_nuisances(run: Identification, point: Array) -> tuple[Nuisances, ...]:
    """The nuisances of all samples to fit at a search point (d,)."""
    points, steps = probes(point[None, :], run.space.upper)
    batch = run.space.decode(points)
    trims = shared_trims(run.model, batch, run.training, run.settings.start)
    return tuple(_nuisances(run, case, batch, found, steps[0]) for case, found in trims)


def _nuisances(
    run: Identification, case: SampleCase, batch: ParameterBatch, found: Trim, steps: Array
) -> Nuisances:
    setup = case.setup
    left = reduced_errors(run.model, batch, case, found)
    columns, prior = linear_columns(setup)
    spread = np.concatenate([np.zeros(int(setup.offset.sum())), setup.start_spread, setup.angle_spread])
    names = [f"bias.{name}" for name, free in zip(setup.channels, setup.offset, strict=True) if free]
    if setup.start_columns.shape[2]:
        names += [f"start.{START[part]}" for part in free_parts(case)]
    names += [f"first_angle.{drive}" for drive in setup.angle_names]
    if setup.openness.delay:
        names.append("delay")
        columns = np.concatenate([columns, left.slope[0][..., None]], axis=2)
        prior = np.append(prior, (PRIOR_RAD / DELAY_SPREAD_S) ** 2)
        spread = np.append(spread, DELAY_SPREAD_S)
    known = np.isfinite(columns) & np.isfinite(setup.values)[..., None]
    weighted = np.where(known, columns, 0.0) * setup.weight[:, None]
    slope = (left.nuisance[1:] - left.nuisance[0]) / steps[:, None]
    return Nuisances(tuple(names), left.nuisance[0], weighted[:, setup.fitted], slope.T, prior, spread)


def fit_records(
    run: Identification,
    residual: Array,
    jacobian: Array,
    motions_rad: Sequence[float],
    nuisances: Sequence[Nuisances],
) -> tuple[Record, ...]:
    """Residuals (m,) and Jacobian (m, d) of a whole fit by sample, with the columns of its nuisances."""
    cases = run.training
    ends = np.cumsum([case.setup.residual_count for case in cases])
    parts = zip(
        cases,
        np.split(residual, ends[:-1]),
        np.split(jacobian, ends[:-1]),
        motions_rad,
        nuisances,
        strict=True,
    )
    found = []
    for case, own, slope, motion, nuisance in parts:
        shape = (case.sample.time_s.size, int(case.setup.fitted.sum()))
        found.append(
            Record(
                case.sample.time_s,
                own.reshape(shape),
                slope.reshape(*shape, -1),
                motion,
                nuisance=nuisance.columns,
                nuisance_prior=nuisance.prior,
                nuisance_spread=nuisance.spread,
                nuisance_slope=nuisance.slope,
            )
        )
    return tuple(found)


def measurement_documents(
    run: Identification, nuisances: Sequence[Nuisances], noise: ColouredNoise | None
) -> dict[str, Any]:
    """What was found out about each sample to fit, by its name, as the result has it."""
    documents = {}
    for number, (case, found) in enumerate(zip(run.training, nuisances, strict=True)):
        size = len(found.names)
        errors = np.full(size, np.nan)
        if noise is not None:
            errors = np.sqrt(np.maximum(np.diag(noise.nuisance_covariance(number)), 0.0))
        estimates = {
            name: {"value": float(value), "standard_error": float(error) if np.isfinite(error) else None}
            for name, value, error in zip(found.names, found.value, errors, strict=True)
        }
        documents[case.sample.name] = _document(case, estimates)
    return documents


def _document(case: SampleCase, estimates: Mapping[str, Mapping[str, float | None]]) -> dict[str, Any]:
    openness, sample = case.setup.openness, case.sample
    # the flight begins with the heading of the first row, and the rest is the offset
    heading = dict(estimates[f"bias.{HEADING}"])
    heading["value"] = float(sample.psi[0]) + (heading["value"] or 0.0)
    biases = {name: dict(estimates[f"bias.{name}"]) for name in openness.bias}
    if HEADING in biases:
        biases[HEADING] = heading
    start = {}
    for name, moved in zip(START, openness.start_value, strict=True):
        if f"start.{name}" in estimates:
            estimate = dict(estimates[f"start.{name}"])
            start[name] = {**estimate, "value": moved + (estimate["value"] or 0.0)}
    return {
        "bias": biases,
        "delay_s": dict(estimates["delay"]) if openness.delay else None,
        "heading_rad": heading,
        "initial_state": start,
        "first_angle_rad": {
            drive: dict(estimates[f"first_angle.{drive}"]) for drive in case.setup.angle_names
        },
        "sigma": dict(openness.sigma),
        "noise_rad": angle_noise(sample),
        "reason": openness.reason or "the readings show no noise, and no bias or delay explains their errors",
    }
