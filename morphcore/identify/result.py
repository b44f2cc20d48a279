"""The result of an identification: model, fit on every sample, uncertainty, search and cost."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.bands import Band, bands_of_cases
from morphcore.identify.belief import Belief, belief_of, fit_noise
from morphcore.identify.cost import SampleCase, fly_measured, shared_trims
from morphcore.identify.cramer_rao import cramer_rao_percent
from morphcore.identify.diagnoses import diagnoses
from morphcore.identify.fit_warnings import fit_warnings, not_flyable
from morphcore.identify.posterior import Posterior
from morphcore.identify.sample_fit import SampleFit
from morphcore.identify.sample_measurement import fitted_nuisances, measurement_documents
from morphcore.identify.uncertainty import Uncertainty, no_uncertainty, uncertainty
from morphcore.identify.verdict import Verdict, verdict
from morphcore.models.equivalent import ChainModel, ParameterBatch, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.search.run import SearchState
from morphcore.shown import Shown, Summary
from morphcore.validity import ResultWarning, documents
from morphdata.identify import EquivalentModel
from morphdata.links import shown_per_wing
from morphdata.measurement import ANGLES
from morphdata.renamed import both_spellings, under_both_spellings

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class IdentifyResult(Shown):
    """An identified equivalent model with its proof.

    Attributes
    ----------
    model : ChainModel
        Topology and lattice.
    parameters : ParameterBatch
        The identified parameters, SI units: a batch of one.
    fits : tuple of SampleFit
        How well each sample is met.
    uncertainty : Uncertainty or None
        How well the samples determine the parameters; None where nothing was searched, or nothing flies.
    search : dict
        Method, effort and history of the search.
    cost : dict of str to float or None
        Wall times of single flights, s.
    settings : EquivalentModel
        As requested; step and corrections that were left to the search are filled in.
    warnings : tuple of ResultWarning
        What the method does not answer for.
    at_bound : tuple of str
        Parameters that ended at a bound of the search.
    values : dict of str to float
        The identified parameters by the names that their uncertainty has, SI units.
    cramer_rao_percent : dict of str to float or None
        Cramer-Rao bound of each searched parameter, per cent of its value.
    measurement : mapping of str to dict
        Biases, delay and heading that were found, by the name of the sample; empty where nobody has looked.
    belief : Belief
        Posterior, profile likelihoods and what predictive bands are made of.
    bands : tuple of Band
        Predictive bands of the samples that were held out.
    """

    model: ChainModel
    parameters: ParameterBatch
    fits: tuple[SampleFit, ...]
    uncertainty: Uncertainty | None
    search: dict[str, Any]
    cost: dict[str, float | None]
    settings: EquivalentModel
    warnings: tuple[ResultWarning, ...] = ()
    at_bound: tuple[str, ...] = ()
    values: dict[str, float] = field(default_factory=dict)
    cramer_rao_percent: dict[str, float | None] = field(default_factory=dict)
    measurement: Mapping[str, Any] = field(default_factory=dict)
    belief: Belief = field(default_factory=Belief)
    bands: tuple[Band, ...] = ()

    @property
    def posterior(self) -> Posterior | None:
        """Draws of the parameters; None where none were requested."""
        return self.belief.posterior

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the model may be believed, and why."""
        return verdict(
            self.fits,
            self.warnings,
            undetermined=() if self.uncertainty is None else self.uncertainty.undetermined,
            at_bound=self.at_bound,
            measurement=self.measurement,
            finished=bool(self.search.get("finished", True)),
        )

    @property
    def lost(self) -> tuple[SampleFit, ...]:
        """The samples to fit that the best model does not fly to their end: with any, it is no answer."""
        return tuple(fit for fit in self.fits if fit.case.sample.role == "train" and fit.ending("identified"))

    def require_flown(self) -> IdentifyResult:
        """Itself, if its model flies all samples that it was fitted to; else NotFlyable."""
        if self.lost:
            raise not_flyable(self.model, self.lost, self.settings, self.warnings)
        return self

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes; the model is None where the best never flew."""
        return {
            "model": None if self.lost else self._model_document(),
            "fit": [fit.to_document() for fit in self.fits],
            "uncertainty": no_uncertainty(self.at_bound)
            if self.uncertainty is None
            else self.uncertainty.to_document() | self._values_document() | self.belief.to_document(),
            "measurement": dict(self.measurement),
            "search": self.search,
            "cost": self.cost,
            "verdict": self.verdict.to_document(),
            "warnings": documents(self.warnings),
        }

    def _values_document(self) -> dict[str, Any]:
        """Values by the names that the intervals have, and their Cramer-Rao bounds."""
        return {
            "value": under_both_spellings(self.values),
            "cramer_rao_percent": under_both_spellings(self.cramer_rao_percent),
        }

    def _model_document(self) -> dict[str, Any]:
        named = self.parameters.surfaces is not None
        return parameters_document(self.parameters) | {
            **({"separate_wings": self.settings.separate_wings} if named else {}),
            "lattice": self.settings.lattice.to_document(),
            "step_s": self.settings.step_s,
            "start": self.settings.start,
        }

    def summary(self) -> Summary:
        """How well each sample is met, and by which model."""
        angles = [f"rms {angle}, mrad" for angle in ANGLES]
        documents = [fit.to_document() for fit in self.fits]
        return Summary(
            f"IdentifyResult: {shown_per_wing(self.parameters.links_per_wing)}",
            {
                **{
                    f"{parameter.name}, {parameter.unit}": self.parameters[parameter.name]
                    for parameter in self.model.parameters
                },
                "search": {name: self.search.get(name) for name in ("method", "seed", "flights", "wall_s")},
            },
            ("sample", "role", "J rigid, rad^2", "J identified", *angles),
            [
                [fit["sample"], fit["role"], fit["J_rigid"], fit["J_identified"]]
                + [None if fit["rms_rad"][angle] is None else 1e3 * fit["rms_rad"][angle] for angle in ANGLES]
                for fit in documents
            ],
        )

    def curves(self) -> dict[str, Any]:
        """Time histories of all samples for plots and tables."""
        bands = {band.sample: band for band in self.bands}
        return {
            "samples": [
                fit.to_curves() | {"band": bands[fit.case.sample.name].to_curves()}
                if fit.case.sample.name in bands
                else fit.to_curves()
                for fit in self.fits
            ]
        }


def identify_result(run: Identification, state: SearchState, *, judged: bool = True) -> IdentifyResult:
    """Fly the best point so far against all samples; if ``judged``, with its uncertainty and cost too."""
    start, space = run.settings.start, run.space
    rigid = run.chain(run.model.aircraft, run.model.flight, 1)
    fits = _fits(run, rigid, state.best)
    flies = not any(fit.case.sample.role == "train" and fit.ending("identified") for fit in fits)
    certainty = noise = None
    belief = Belief()
    nuisances = fitted_nuisances(run, state.best) if judged and flies else ()
    if judged and space.dimension and flies:
        residual, jacobian = run.linearised(state.best)
        trained = [fit for fit in fits if fit.case.sample.role == "train"]
        motions = [_rms(fit.errors("rigid") * fit.case.weight) for fit in trained]
        noise = fit_noise(run, state.best, residual, jacobian, motions, nuisances)
        certainty = uncertainty(space, state.best, residual, jacobian, noise)
        belief = belief_of(run, state.best, jacobian, noise)
    measurement = measurement_documents(run, nuisances, noise) if nuisances else {}
    best, at_bound = space.decode(state.best), space.at_bound(state.best)
    held_out = [case for case in run.cases if case.sample.role == "held_out"]
    return IdentifyResult(
        model=run.model,
        parameters=best,
        fits=fits,
        uncertainty=certainty,
        search=_search_document(run, state),
        cost=_flight_times(run, rigid, best, judged=judged),
        settings=run.settings.model_copy(
            update={
                "step_s": run.step_s,
                "aero_coefficients": list(space.free_aero),
                "own_lift": list(space.fixed.apart),
            }
        ),
        warnings=fit_warnings(
            run,
            best,
            fits,
            at_bound,
            certainty.undetermined if certainty is not None else (),
            diagnoses(run, fits, state.best, measurement, fly=judged),
        ),
        at_bound=tuple(at_bound),
        values=dict(zip(space.parameter_names, space.flatten(best)[0].tolist(), strict=True)),
        cramer_rao_percent={} if certainty is None else cramer_rao_percent(space, state.best, certainty),
        measurement=measurement,
        belief=belief,
        bands=bands_of_cases(run.model, belief, held_out, start),
    )


def _fits(run: Identification, rigid_model: ChainModel, best: Array) -> tuple[SampleFit, ...]:
    """How the rigid model, the physical guess and a search point (d,) meet each sample."""
    start, space = run.settings.start, run.space
    # a plan knows the lattice and the hinges, not the links: both models fly the same ones
    rigid = _attitudes(rigid_model, physical_guess(rigid_model), run.cases, start)
    both = _attitudes(run.model, space.decode(np.stack([space.guess, best])), run.cases, start)
    return tuple(
        SampleFit(case, r[0], pair[0], pair[1]) for case, r, pair in zip(run.cases, rigid, both, strict=True)
    )


def _search_document(run: Identification, state: SearchState) -> dict[str, Any]:
    """Method, effort and history of the search."""
    return {
        "aero_coefficients": both_spellings(run.space.free_aero),
        "own_lift": list(run.space.fixed.apart),
        "method": run.search.method,
        "seed": run.search.seed,
        "prior_rad": float(np.sqrt(run.prior_weight)),
        "widened": both_spellings(run.widened()),
        "flights": state.flights,
        "generations": state.generation,
        "wall_s": state.wall_s,
        "best_cost": state.best_cost,
        "finished": state.over,
        "history": list(state.history),
    }


def _flight_times(
    run: Identification, rigid: ChainModel, best: ParameterBatch, *, judged: bool
) -> dict[str, float | None]:
    """Wall times of single flights of the longest sample, s; without them where nothing is judged."""
    longest = max(range(len(run.cases)), key=lambda i: run.cases[i].plan.grid.steps)

    def flight_time(model: ChainModel, batch: ParameterBatch) -> float | None:
        return _flight_time(model, batch, run.cases[longest], run.settings.start) if judged else None

    return {
        "rigid_flight_s": flight_time(rigid, physical_guess(rigid)),
        "equivalent_flight_s": flight_time(run.model, best),
        "flexible_flight_s": None,
        "flight_duration_s": run.samples[longest].duration_s,
    }


def _attitudes(
    model: ChainModel, batch: ParameterBatch, cases: tuple[SampleCase, ...], start: Any
) -> list[Array]:
    return [
        fly_measured(model, batch, case, found) for case, found in shared_trims(model, batch, cases, start)
    ]


def _rms(errors: Array) -> float:
    """Root mean square of the finite ones; 0 where the flight diverged and there is none to compare with."""
    known = errors[np.all(np.isfinite(errors), axis=1)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _flight_time(model: ChainModel, batch: ParameterBatch, case: SampleCase, start: Any) -> float:
    """Wall time of one flight alone, trim included, s (kernels are warm by now)."""
    begin = time.perf_counter()
    _attitudes(model, batch, (case,), start)
    return time.perf_counter() - begin
