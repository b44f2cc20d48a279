"""One flight as a request document asks for it: what flies, through which schedules, in which air.

The run is an iterator of steps, so that a caller can show progress and stop; the result is a document with
the trim, the trajectory, a summary and the time that it took.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import CosineGust, DrydenTurbulence, Environment
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight, aircraft_from_document, flight_from_document
from morphcore.geometry.fields import Fields, WholeNumbers
from morphcore.geometry.lattice import DEFAULT_LATTICE, LatticeSettings, lattice_settings
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.flexible import DEFAULT_ELEMENTS
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from morphcore.shown import Shown
from morphcore.simulate.flight import OUTPUT_STEP_S, Simulation, flight_steps
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.schedule_document import SIDES, require_hinge_ranges, schedules_from_document
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode
from morphcore.stopping import Stop
from morphcore.threads import use_threads
from morphcore.validity import documents
from morphdata.samplefiles.flight import FEWEST_ROWS, LONGEST_FLIGHT_S, MOST_ROWS

Array = NDArray[np.float64]
Document = dict[str, Any]
Kind = Literal["rigid", "equivalent", "flexible"]
Clock = Callable[[], float]

KINDS: tuple[Kind, ...] = ("rigid", "equivalent", "flexible")
ANGLES = ("phi", "theta", "psi")
SHORTEST_STEP_S, LONGEST_STEP_S = 1e-5, 0.02
MOST_ELEMENTS = 100
LARGEST_SEED = 2**53 - 1
CHECK_STEP_S = 1e-3  # between looks at a hinge's angle; no schedule turns far in it
VARIATION_STEP_S = 0.01  # the variation is a sum over samples so far apart
# of the trajectory's further columns; the names are those of the example flights
UNITS = {
    **dict.fromkeys(("p", "q", "r"), "rad_s"),
    **dict.fromkeys(("vx", "vy", "vz"), "m_s"),
    **dict.fromkeys(("x", "y", "z", "tip_left_z", "tip_right_z"), "m"),
}


@dataclass(frozen=True)
class FlownModel(WholeNumbers):
    """What flies.

    parameters : of the equivalent model, a batch of one. elements : of each surface, in the flexible model.
    step_s : longest time step, s; None: as `simulate` chooses it.
    """

    kind: Kind
    parameters: ParameterBatch | None = None
    lattice: LatticeSettings = DEFAULT_LATTICE
    elements: int = DEFAULT_ELEMENTS
    step_s: float | None = None
    start: StartMode = "trim"

    @property
    def choice(self) -> Literal["rigid", "flexible"] | ParameterBatch:
        """The model as `simulate` wants it."""
        if self.parameters is not None:
            return self.parameters
        return "flexible" if self.kind == "flexible" else "rigid"

    def to_document(self, step_s: float) -> Document:
        """JSON form, with the longest step, s, that was flown."""
        return {
            "kind": self.kind,
            **({} if self.parameters is None else {"parameters": parameters_document(self.parameters)}),
            "lattice": self.lattice.to_document(),
            **({"elements": self.elements} if self.kind == "flexible" else {}),
            "step_s": step_s,
            "start": self.start,
        }


@dataclass(frozen=True)
class SimulationStep:
    """How far a flight has come, 0..1, and a sentence to show."""

    fraction: float
    message: str


@dataclass(frozen=True, repr=False)
class SimulationResult(Shown):
    """A flown flight and what it cost: wall time of trim, preparation and flight together, s."""

    model: FlownModel
    simulation: Simulation
    wall_s: float

    @property
    def trajectory(self) -> Trajectory:
        """Attitude and sweep over time."""
        return self.simulation.trajectory

    def to_document(self) -> Document:
        """JSON form with the names of the API; the summary's angles are departures from the start."""
        flown, trim = self.trajectory, self.simulation.trim
        tips = {side: flown.extra.get(f"tip_{side}_z") for side in SIDES}
        return {
            "model": self.model.to_document(self.simulation.step_s),
            "trim": {
                "alpha_rad": float(trim.alpha[0]),
                "force_b_n": trim.force_B[0].tolist(),
                "moment_b_n_m": trim.moment_B[0].tolist(),
                "tip_z_m": {side: None if z is None else float(z[0]) for side, z in tips.items()},
            },
            "trajectory": trajectory_document(flown),
            "summary": {
                "max_abs_rad": dict(zip(ANGLES, np.abs(_departure(flown)).max(axis=0).tolist(), strict=True)),
                "variation_rad2": attitude_variation(flown),
            },
            "cost": {
                "wall_s": self.wall_s,
                "real_time_factor": flown.duration_s / self.wall_s if self.wall_s > 0.0 else None,
            },
            "warnings": documents(self.simulation.warnings),
        }


@dataclass
class SimulationRun(WholeNumbers):
    """One flight, ready to be flown.

    schedules : of each side. seed : of the turbulence.
    """

    aircraft: Aircraft
    flight: Flight
    model: FlownModel
    schedules: Mapping[str, Schedule]
    duration_s: float
    output_step_s: float = OUTPUT_STEP_S
    environment: Environment | None = None
    seed: int = 1
    clock: Clock = time.perf_counter
    _flown: SimulationResult | None = field(default=None, init=False, repr=False)

    def steps(self, stop: Stop | None = None) -> Iterator[SimulationStep]:
        """Fly; several steps a second.

        Parameters
        ----------
        stop : asked between them; True raises Interrupted.

        Raises
        ------
        TrimNotFound, FlightDiverged : as of `simulate`.
        """
        wall_s, begin = 0.0, self.clock()
        for step in flight_steps(
            self.aircraft, self.flight, self.schedules, model=self.model.choice, duration_s=self.duration_s,
            output_step_s=self.output_step_s, step_s=self.model.step_s, start=self.model.start,
            environment=self.environment, rng=np.random.default_rng(self.seed), lattice=self.model.lattice,
            elements=self.model.elements, stop=stop,
        ):  # fmt: skip
            wall_s += self.clock() - begin  # without what the caller does between two steps
            if step.simulation is not None:
                self._flown = SimulationResult(self.model, step.simulation, wall_s)
            flown_s = step.fraction * self.duration_s
            yield SimulationStep(
                step.fraction, f"{self.model.kind} model: {flown_s:.2f} of {self.duration_s:g} s flown"
            )
            begin = self.clock()

    def result(self) -> SimulationResult:
        """The flight; flown now if it has not been."""
        if self._flown is None:
            for _ in self.steps():
                pass
        return cast("SimulationResult", self._flown)


def simulation_from_document(document: Document, threads: int | None = None) -> SimulationRun:
    """The flight that a request document (the body of ``POST /simulate``) asks for.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    fields = Fields(document, "")
    aircraft = aircraft_from_document(fields.raw("aircraft"))
    flight = flight_from_document(fields.raw("flight"))
    model = flown_model(fields.raw("model"))
    schedules = schedules_from_document(fields.raw("schedules"), aircraft)
    duration_s = fields.number("duration_s", above=0.0, most=LONGEST_FLIGHT_S)
    output_step_s = fields.number("output_step_s", default=OUTPUT_STEP_S, above=0.0, most=LONGEST_FLIGHT_S)
    environment, seed = environment_from_document(fields.raw("environment", {}))
    fields.raw("execution", None)  # how a service runs it: no number depends on that
    fields.done()
    rows = duration_s / output_step_s + 1
    if not FEWEST_ROWS <= rows <= MOST_ROWS:
        raise InvalidInput(
            f"{duration_s:g} s in steps of {output_step_s:g} s make {rows:.0f} rows",
            pointer="/output_step_s",
            hint=f"choose duration_s and output_step_s for {FEWEST_ROWS} to {MOST_ROWS} rows",
        )
    if model.start == "given" and flight.start is None:
        raise InvalidInput(
            "the flight has no start", pointer="/flight/start", hint="add it, or choose start = trim"
        )
    both = Fields(document["schedules"], "/schedules").has("both")
    require_hinge_ranges(
        aircraft,
        schedules,
        np.linspace(0.0, duration_s, int(np.ceil(duration_s / CHECK_STEP_S)) + 1),
        {side: f"/schedules/{'both' if both else side}" for side in SIDES},
    )
    return SimulationRun(aircraft, flight, model, schedules, duration_s, output_step_s, environment, seed)


def flown_model(document: Any, pointer: str = "/model") -> FlownModel:
    """Read the model's part of a request.

    ``{"kind", "parameters" (equivalent only), "lattice", "elements" (flexible only), "step_s", "start"}``.
    Parameters of an identification's result bring their own lattice, step and start: the model was identified
    with them and flies with them, unless others are given beside.
    """
    fields = Fields(document, pointer)
    kind: Kind = fields.choice("kind", KINDS)  # type: ignore[assignment]
    for name, only in (("parameters", "equivalent"), ("elements", "flexible")):
        if fields.has(name) and kind != only:
            raise InvalidInput(
                f"{name} do not belong to the {kind} model",
                pointer=f"{pointer}/{name}",
                hint=f"leave them out, or choose the {only} model",
            )
    own, parameters = FlownModel(kind), None
    if kind == "equivalent":
        parameters = parameters_from_document(fields.raw("parameters"), f"{pointer}/parameters")
        own = _identified_with(fields.raw("parameters"), f"{pointer}/parameters")
    step_s = fields.optional_number("step_s", least=SHORTEST_STEP_S, most=LONGEST_STEP_S)
    model = FlownModel(
        kind,
        parameters,
        lattice=lattice_settings(fields.raw("lattice"), f"{pointer}/lattice")
        if fields.has("lattice")
        else own.lattice,
        elements=fields.whole("elements", default=DEFAULT_ELEMENTS, least=1, most=MOST_ELEMENTS),
        step_s=own.step_s if step_s is None else step_s,
        start=fields.choice("start", ("trim", "given"), default=own.start),  # type: ignore[arg-type]
    )
    fields.done()
    return model


def _identified_with(document: Any, pointer: str) -> FlownModel:
    """Lattice, step and start that stand beside identified parameters; defaults where they do not."""
    whole = Fields(document, pointer)
    fields = whole.child("model") if whole.has("model") else whole
    return FlownModel(
        "equivalent",
        lattice=lattice_settings(fields.raw("lattice", {}), f"{fields.pointer}/lattice"),
        step_s=fields.optional_number("step_s", least=SHORTEST_STEP_S, most=LONGEST_STEP_S),
        start=fields.choice("start", ("trim", "given"), default="trim"),  # type: ignore[arg-type]
    )


def environment_from_document(document: Any, pointer: str = "/environment") -> tuple[Environment | None, int]:
    """Read gust, turbulence and the turbulence's seed; None for still air.

    ``{"gust": {"amplitude_m_s", "gradient_m", "start_s", "direction_n"}, "turbulence": {"wind_20ft_m_s",
    "sigma_high_m_s"}, "seed"}``; see `morphcore.aero.environment`.
    """
    fields = Fields(document, pointer)
    gust = turbulence = None
    if fields.has("gust"):
        child = fields.child("gust")
        north, east, down = child.vector("direction_n", default=CosineGust.direction_N).tolist()
        if north == east == down == 0.0:
            raise InvalidInput(
                "the gust has no direction",
                pointer=f"{pointer}/gust/direction_n",
                hint="give [0, 0, -1] for up",
            )
        gust = CosineGust(
            amplitude_m_s=child.number("amplitude_m_s", least=-100.0, most=100.0),
            gradient_m=child.number("gradient_m", above=0.0, most=1e4),
            start_s=child.number("start_s", default=0.0, least=0.0, most=LONGEST_FLIGHT_S),
            direction_N=(north, east, down),
        )
        child.done()
    if fields.has("turbulence"):
        child = fields.child("turbulence")
        turbulence = DrydenTurbulence(
            wind_20ft_m_s=child.number("wind_20ft_m_s", default=0.0, least=0.0, most=100.0),
            sigma_high_m_s=child.number("sigma_high_m_s", default=0.0, least=0.0, most=50.0),
        )
        child.done()
    seed = fields.whole("seed", default=1, least=0, most=LARGEST_SEED)
    fields.done()
    still = gust is None and turbulence is None
    return (None if still else Environment(gust, turbulence)), seed


def attitude_variation(trajectory: Trajectory) -> float:
    """Sum over samples 10 ms apart of the squared departures of the Euler angles from their start, rad^2.

    Rows at other (even) distances count for as long as they last.
    """
    step_s = trajectory.duration_s / (trajectory.time_s.size - 1)
    return float(np.sum(_departure(trajectory) ** 2) * step_s / VARIATION_STEP_S)


def _departure(trajectory: Trajectory) -> Array:
    """Departure of the Euler angles from their start, (k, 3) rad; full turns count."""
    return np.asarray(np.unwrap(trajectory.euler, axis=0) - trajectory.euler[0])


def trajectory_document(trajectory: Trajectory) -> Document:
    """Columns of a flown flight, SI units and radians, with the units in their names."""
    columns = {
        "time_s": trajectory.time_s,
        "sweep_left_rad": trajectory.sweep_left,
        "sweep_right_rad": trajectory.sweep_right,
        **{f"{angle}_rad": getattr(trajectory, angle) for angle in ANGLES},
        **{f"{name}_{UNITS[name]}" if name in UNITS else name: v for name, v in trajectory.extra.items()},
    }
    return {name: values.tolist() for name, values in columns.items()}
