"""One flight described by a request document: the model, the schedules and the air.

The run is an iterator of steps, so that a caller can show progress and stop it; the result is a document with
the trim, the trajectory, a summary and the computing time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.parameters_document import parameter_batch, parameters_document
from morphcore.shown import Shown
from morphcore.simulate.flight import ModelChoice, Simulation, flight_steps
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Stop
from morphcore.threads import use_threads
from morphcore.validity import documents
from morphdata.channels import document_name
from morphdata.drives import SIDES
from morphdata.measurement import ANGLES
from morphdata.parameters import KnownModel, flown_with
from morphdata.simulate import DEFAULT_ELEMENTS, FlexibleModel, FlightModel, SimulateRequest

Array = NDArray[np.float64]
Document = dict[str, Any]
Clock = Callable[[], float]

VARIATION_STEP_S = 0.01  # spacing of the samples over which the variation is summed


@dataclass(frozen=True)
class SimulationStep:
    """Progress of a flight, 0..1, and a message to show."""

    fraction: float
    message: str


@dataclass(frozen=True, repr=False)
class SimulationResult(Shown):
    """A flown flight and its cost: total wall time of trim, preparation and flight, s.

    ``turn_rate_rad_s`` is that of the steady flight in which it begins.
    """

    model: FlightModel
    simulation: Simulation
    wall_s: float
    turn_rate_rad_s: float = 0.0

    @property
    def trajectory(self) -> Trajectory:
        """Attitude and sweep over time."""
        return self.simulation.trajectory

    def to_document(self) -> Document:
        """JSON form with the names of the API; the summary's angles are departures from the steady start."""
        flown, trim = self.trajectory, self.simulation.trim
        driven, away = bool(trim.thrust_moment_B.any()), _departure(flown, self.turn_rate_rad_s)
        return {
            "model": model_document(self.model, self.simulation.step_s),
            "trim": {
                "alpha_rad": float(trim.alpha[0]),
                **({"bank_rad": float(trim.bank[0])} if trim.bank[0] else {}),
                "force_b_n": trim.force_B[0].tolist(),
                "moment_b_n_m": trim.moment_B[0].tolist(),
                **({"drives_rad": dict(self.simulation.trim_drives)} if self.simulation.trim_drives else {}),
                **({"thrust_moment_b_n_m": trim.thrust_moment_B[0].tolist()} if driven else {}),
                "tip_z_m": {side: self.simulation.start_tips_z.get(side) for side in SIDES},
            },
            "trajectory": trajectory_document(flown),
            "drives": list(flown.drive_order),
            **self._requested(),
            "summary": {
                "max_abs_rad": dict(zip(ANGLES, np.abs(away).max(axis=0).tolist(), strict=True)),
                "variation_rad2": attitude_variation(flown, self.turn_rate_rad_s),
            },
            "cost": {
                "wall_s": self.wall_s,
                "real_time_factor": flown.duration_s / self.wall_s if self.wall_s > 0.0 else None,
            },
            "warnings": documents(self.simulation.warnings),
        }

    def _requested(self) -> Document:
        """Shape and strips, where these are requested."""
        shape, strips = self.simulation.shape, self.simulation.strips
        return {
            **({} if shape is None else {"shape": shape.to_document()}),
            **({"sections": [each.to_document() for each in strips]} if strips else {}),
        }


class SimulationRun:
    """One flight, ready to be flown.

    Parameters
    ----------
    request : SimulateRequest
        The model, the schedules and the air.
    clock : callable
        Returns the time, s.

    Raises
    ------
    InvalidInput
        The model is given by an id, which only a service can resolve.
    """

    def __init__(self, request: SimulateRequest, clock: Clock = time.perf_counter) -> None:
        model = request.model
        if isinstance(model, KnownModel) and model.known is None:
            raise InvalidInput(
                "a model id can only be resolved by the service",
                pointer="/model/model_id",
                hint="give the model's parameters instead",
            )
        self.request = request
        self.clock = clock
        self._flown: SimulationResult | None = None

    def steps(self, stop: Stop | None = None) -> Iterator[SimulationStep]:
        """Fly, with several steps a second.

        Parameters
        ----------
        stop : callable, optional
            Called between steps; True raises Interrupted.

        Raises
        ------
        InvalidInput
            A schedule leaves its hinge's range between the angles that it names.
        TrimNotFound, FlightDiverged
            As in `simulate`.
        """
        request, model, air = self.request, self.request.model, self.request.environment
        flown = flown_with(model)
        wall_s, begin = 0.0, self.clock()
        for step in flight_steps(
            Aircraft.of(request.aircraft), Flight.of(request.flight), request.schedules,
            model=self._choice(),
            duration_s=request.duration_s, output_step_s=request.output_step_s, step_s=flown.step_s,
            start=flown.start, environment=None if air is None or air.still else air,
            rng=np.random.default_rng(1 if air is None else air.seed), lattice=flown.lattice,
            elements=model.elements if isinstance(model, FlexibleModel) else DEFAULT_ELEMENTS,
            channels=request.channels, points=request.points, shape_times_s=request.shape_times_s, stop=stop,
        ):  # fmt: skip
            wall_s += self.clock() - begin  # excludes the caller's work between two steps
            if step.simulation is not None:
                turn = request.flight.turn_rate_rad_s
                self._flown = SimulationResult(model, step.simulation, wall_s, turn)
            flown_s = step.fraction * request.duration_s
            yield SimulationStep(
                step.fraction, f"{model.kind} model: {flown_s:.2f} of {request.duration_s:g} s flown"
            )
            begin = self.clock()

    def _choice(self) -> ModelChoice:
        model = self.request.model
        if isinstance(model, KnownModel) and model.known is not None:
            return parameter_batch(model.known)
        return "flexible" if isinstance(model, FlexibleModel) else "rigid"

    def result(self) -> SimulationResult:
        """The flight; flown now if it has not been."""
        if self._flown is None:
            for _ in self.steps():
                pass
        return cast("SimulationResult", self._flown)


def simulation_from_document(document: Document, threads: int | None = None) -> SimulationRun:
    """Return the flight described by a request document, the body of ``POST /simulate``.

    Raises
    ------
    InvalidInput
        Lists every fault.
    """
    if threads is not None:
        use_threads(threads)
    return SimulationRun(SimulateRequest.parse(document))


def model_document(model: FlightModel, step_s: float) -> Document:
    """Return the JSON form of a model that was flown with steps of at most ``step_s``, s."""
    flown = flown_with(model)
    known = model.known if isinstance(model, KnownModel) else None
    return {
        "kind": model.kind,
        **({} if known is None else {"parameters": parameters_document(parameter_batch(known))}),
        "lattice": flown.lattice.to_document(),
        **({"elements": model.elements} if isinstance(model, FlexibleModel) else {}),
        "step_s": step_s,
        "start": flown.start,
    }


def attitude_variation(trajectory: Trajectory, turn_rate_rad_s: float = 0.0) -> float:
    """Sum over samples 10 ms apart of the squared departures of Euler angles from the steady start, rad^2.

    Rows at another (even) spacing are weighted by their duration.
    """
    step_s = trajectory.duration_s / (trajectory.time_s.size - 1)
    return float(np.sum(_departure(trajectory, turn_rate_rad_s) ** 2) * step_s / VARIATION_STEP_S)


def _departure(trajectory: Trajectory, turn_rate_rad_s: float) -> Array:
    """Departure of the Euler angles from those of the steady flight, (k, 3) rad, unwrapped."""
    away = np.asarray(np.unwrap(trajectory.euler, axis=0) - trajectory.euler[0])
    away[:, 2] -= turn_rate_rad_s * (trajectory.time_s - trajectory.time_s[0])
    return away


def trajectory_document(trajectory: Trajectory) -> Document:
    """Columns of a flown flight, SI units and radians, with the units in their names."""
    columns = {
        "time_s": trajectory.time_s,
        "sweep_left_rad": trajectory.sweep_left,
        "sweep_right_rad": trajectory.sweep_right,
        **{trajectory.field_of(name): trajectory.drives[name] for name in trajectory.drive_order},
        **{f"{angle}_rad": getattr(trajectory, angle) for angle in ANGLES},
        **{document_name(name): values for name, values in trajectory.extra.items()},
    }
    return {name: values.tolist() for name, values in columns.items()}
