"""The result of an identification: model, fit on every sample, uncertainty, search and cost."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import wrap_angle
from morphcore.identify.cost import SampleCase, fly_attitudes, residuals, shared_trims
from morphcore.identify.polish import differences
from morphcore.identify.settings import ModelSettings
from morphcore.identify.state import SearchState
from morphcore.identify.uncertainty import Uncertainty, uncertainty
from morphcore.models.equivalent import ChainModel, ParameterBatch, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.shown import Shown, Summary

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

ANGLES = ("phi", "theta", "psi")


@dataclass(frozen=True, repr=False)
class SampleFit(Shown):
    """Attitudes (k, 3) flown against one sample by the rigid, the guessed and the identified model, rad."""

    case: SampleCase
    rigid: Array
    initial: Array
    identified: Array

    def J(self, model: str) -> float | None:
        """The sample's part of J for a model, rad^2; None where its flight diverged."""
        return _number(np.sum((self.errors(model) * self.case.weight) ** 2))

    def errors(self, model: str) -> Array:
        """(k, 3) wrapped angle differences, rad."""
        return wrap_angle(getattr(self, model) - self.case.sample.euler)

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes, and the rigid model's errors beside."""

        def per_angle(values: Array) -> dict[str, float | None]:
            return {angle: _number(value) for angle, value in zip(ANGLES, values, strict=True)}

        identified, rigid = self.errors("identified"), self.errors("rigid")
        return {
            "sample": self.case.sample.name,
            "role": self.case.sample.role,
            "J_rigid": self.J("rigid"),
            "J_initial": self.J("initial"),
            "J_identified": self.J("identified"),
            "rms_rad": per_angle(np.sqrt(np.mean(identified**2, axis=0))),
            "max_abs_rad": per_angle(np.abs(identified).max(axis=0)),
            "rms_rigid_rad": per_angle(np.sqrt(np.mean(rigid**2, axis=0))),
            "range_rad": per_angle(np.ptp(self.case.sample.euler, axis=0)),
        }

    def to_curves(self) -> dict[str, Any]:
        """Time histories for plots and tables."""
        sample = self.case.sample

        def angles(values: Array) -> dict[str, list[float | None]]:
            return {
                f"{name}_rad": [_number(v) for v in column]
                for name, column in zip(ANGLES, values.T, strict=True)
            }

        return {
            "name": sample.name,
            "role": sample.role,
            "time_s": sample.time_s.tolist(),
            "sweep_left_rad": sample.sweep_left.tolist(),
            "sweep_right_rad": sample.sweep_right.tolist(),
            "measured": angles(sample.euler),
            "rigid": angles(self.rigid),
            "initial": angles(self.initial),
            "identified": angles(self.identified),
        }


@dataclass(frozen=True, repr=False)
class IdentifyResult(Shown):
    """An identified equivalent model (``parameters``, a batch of one) with its proof.

    ``settings`` : as asked for; step and corrections that were left to the search are filled in.
    """

    model: ChainModel
    parameters: ParameterBatch
    fits: tuple[SampleFit, ...]
    uncertainty: Uncertainty | None
    search: dict[str, Any]
    cost: dict[str, float | None]
    settings: ModelSettings

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes."""
        return {
            "model": parameters_document(self.parameters)
            | {
                "lattice": self.settings.lattice.to_document(),
                "step_s": self.settings.step_s,
                "start": self.settings.start,
            },
            "fit": [fit.to_document() for fit in self.fits],
            "uncertainty": {"standard_error": {}, "correlation": [], "unidentifiable": []}
            if self.uncertainty is None
            else self.uncertainty.to_document(),
            "search": self.search,
            "cost": self.cost,
        }

    def summary(self) -> Summary:
        """How well each sample is met, and by which model."""
        angles = [f"rms {angle}, mrad" for angle in ANGLES]
        documents = [fit.to_document() for fit in self.fits]
        return Summary(
            f"IdentifyResult: {self.parameters.links} links per wing",
            {
                "stiffness, N m/rad": self.parameters.stiffness,
                "damping, N m s/rad": self.parameters.damping,
                "division": self.parameters.division,
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
        return {"samples": [fit.to_curves() for fit in self.fits]}


def identify_result(run: Identification, state: SearchState, *, judged: bool = True) -> IdentifyResult:
    """Fly the best point so far against all samples; if ``judged``, with its uncertainty and cost too."""
    start, space = run.settings.start, run.space
    rigid_model = run.chain(run.model.aircraft, run.model.flight, 1)
    # a plan knows the lattice and the hinges, not the links: both models fly the same ones
    rigid = _attitudes(rigid_model, physical_guess(rigid_model), run.cases, start)
    both = _attitudes(run.model, space.decode(np.stack([space.guess, state.best])), run.cases, start)
    certainty = None
    if judged and space.dimension and np.isfinite(state.best_cost):

        def errors(points: Array) -> Array:
            return residuals(run.model, space.decode(points), run.training, start)

        residual, jacobian = differences(state.best[None, :], space.upper, errors)
        certainty = uncertainty(space, state.best, residual[0], jacobian[0])
    best = space.decode(state.best)
    longest = max(range(len(run.cases)), key=lambda i: run.cases[i].plan.grid.steps)

    def flight_time(model: ChainModel, batch: ParameterBatch) -> float | None:
        return _flight_time(model, batch, run.cases[longest], start) if judged else None

    settings = run.search
    return IdentifyResult(
        model=run.model,
        parameters=best,
        fits=tuple(
            SampleFit(case, r[0], pair[0], pair[1])
            for case, r, pair in zip(run.cases, rigid, both, strict=True)
        ),
        uncertainty=certainty,
        search={
            "aero_coefficients": list(space.free_aero),
            "method": settings.method,
            "seed": settings.seed,
            "flights": state.flights,
            "generations": state.generation,
            "wall_s": state.wall_s,
            "best_cost": state.best_cost,
            "finished": state.phase == "done",
            "history": list(state.history),
        },
        cost={
            "rigid_flight_s": flight_time(rigid_model, physical_guess(rigid_model)),
            "equivalent_flight_s": flight_time(run.model, best),
            "flexible_flight_s": None,
            "flight_duration_s": run.samples[longest].duration_s,
        },
        settings=replace(run.settings, step_s=run.step_s, aero_coefficients=space.free_aero),
    )


def _attitudes(
    model: ChainModel, batch: ParameterBatch, cases: tuple[SampleCase, ...], start: Any
) -> list[Array]:
    return [
        fly_attitudes(model, batch, case, found) for case, found in shared_trims(model, batch, cases, start)
    ]


def _flight_time(model: ChainModel, batch: ParameterBatch, case: SampleCase, start: Any) -> float:
    """Wall time of one flight alone, trim included, s (kernels are warm by now)."""
    begin = time.perf_counter()
    _attitudes(model, batch, (case,), start)
    return time.perf_counter() - begin


def _number(value: Any) -> float | None:
    number = float(value)
    return number if np.isfinite(number) else None
