"""The study over the number of links per wing: what each costs, what it gains, which to take.

Equivalent models of 1 to 16 links are identified from the same samples, one after the other, and flown alone
for their cost (the paper's Table 1; 1 is the rigid model with its aerodynamic corrections identified). Like
an identification it is an iterator of steps with a complete state each.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify import flown_inputs
from morphcore.identify.drive_histories import smoothed_samples
from morphcore.identify.identification import Identification
from morphcore.identify.settings import SearchSettings, search_settings
from morphcore.identify.study_result import StudyResult, study_result
from morphcore.identify.study_row import StudyRow, study_row
from morphcore.identify.study_state import StudyState, decode, encode
from morphcore.identify.study_timing import ROUNDS, FlightTiming, Flyable, flight_timing, medians
from morphcore.models.equivalent import physical_guess
from morphcore.search.run import Clock
from morphcore.search.step import Step
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Stop
from morphcore.threads import one_blas_thread, use_threads
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.identify import EquivalentModel, Search, SearchedModel
from morphdata.links import LinksPerWing, shown_links
from morphdata.measurement import Measurement
from morphdata.renamed import both_spellings
from morphdata.study import StudiedModels, StudyRequest

LINKS = tuple(StudiedModels().links_per_wing)
TIMING_FRACTION = 0.02  # of the whole work, for the progress that is shown


class Study:
    """Identifications with several numbers of links per wing.

    Parameters
    ----------
    links : numbers of links, all different; they are worked off in this order.
    model, search, measurement : as of one identification; ``links_per_wing`` is not looked at.
        ``max_seconds`` is the time for all, divided by the number of unknowns; what one leaves over is for
        the next ones.

    Raises
    ------
    InvalidInput : as of an identification, or the numbers of links make no sense.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Flight,
        samples: Sequence[Trajectory],
        *,
        links: Sequence[LinksPerWing] = LINKS,
        model: SearchedModel | None = None,
        search: SearchSettings | None = None,
        measurement: Measurement | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.links = tuple(StudiedModels.parse({"links_per_wing": [*links]}, "/model").links_per_wing)
        self.search = search or SearchSettings()
        self._clock = clock
        settings = StudiedModels() if model is None else model
        smoothed = smoothed_samples(aircraft, samples, measurement)
        # all at once: what is wrong with the settings of six links is said before one link is identified
        self.runs = tuple(
            Identification(
                aircraft,
                flight,
                smoothed,
                _of_links(settings, n),
                self.search,
                measurement=measurement,
                clock=clock,
            )
            for n in self.links
        )
        self._prepared: FlightTiming | None = None

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Study, one step of one identification after the other, then the rounds of timing.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts anew. The result is the same to the bit, but for times.
        stop : asked between chunks of well under a second; True raises Interrupted.
        """
        state = StudyState("search", self.links) if checkpoint is None else decode(checkpoint, self.links)
        while state.phase != "done":
            begin = self._clock()
            state, step = self._advance(state, stop)
            state = replace(state, wall_s=state.wall_s + self._clock() - begin)
            yield replace(
                step,
                generation=state.generation,
                fraction=self._fraction(state),
                flights=state.flights,
                checkpoint=encode(state),
            )

    def result(self, checkpoint: bytes) -> StudyResult:
        """The rows at any step; that of the identification that runs comes with its best so far.

        Raises
        ------
        NotFlyable : no model of any size flies the samples that it was fitted to.
        """
        return self._result(decode(checkpoint, self.links), judged=True).require_flown()

    def best_so_far(self, checkpoint: bytes) -> StudyResult:
        """The same without judging the running one's uncertainty: someone waits for a cancelled study."""
        return self._result(decode(checkpoint, self.links), judged=False)

    # one step each

    def _advance(self, state: StudyState, stop: Stop | None) -> tuple[StudyState, Step]:
        if state.phase == "search":
            return self._search(state, stop)
        return self._judge(state) if state.phase == "result" else self._time(state, stop)

    def _search(self, state: StudyState, stop: Stop | None) -> tuple[StudyState, Step]:
        """One step of the identification that runs."""
        if state.search is None:
            state = replace(state, budget_s=self._budget(state))
        step = next(self._run(state).steps(state.search, stop))
        links = state.links[len(state.rows)]
        done = sum(row.flights for row in state.rows)
        moved = replace(
            state,
            phase="result" if step.fraction >= 1.0 else "search",
            search=step.checkpoint,
            share=step.fraction,
            best_cost=step.best_cost,
            generation=state.generation + 1,
            flights=done + step.flights,
        )
        return moved, replace(step, message=f"{shown_links(links)}: {step.message}")

    def _judge(self, state: StudyState) -> tuple[StudyState, Step]:
        """The result of an identification that came to its end."""
        row = self._row(state, judged=True)
        rows = (*state.rows, row)
        moved = replace(
            state,
            phase="timing" if len(rows) == len(self.links) else "search",
            rows=rows,
            search=None,
            share=0.0,
            budget_s=None,
        )
        return moved, self._reported("result", state, f"{shown_links(row.links_per_wing)}: {_found(row)}")

    def _time(self, state: StudyState, stop: Stop | None) -> tuple[StudyState, Step]:
        """One round of single flights of all models."""
        with one_blas_thread():
            timing = self._timing(state.rows)
            rounds = (*state.rounds, timing.round(stop))
        moved = replace(
            state,
            phase="done" if len(rounds) >= ROUNDS else "timing",
            rounds=rounds,
            plan_s=timing.plan_s if state.plan_s is None else state.plan_s,
        )
        return moved, self._reported("timing", moved, f"timing: round {len(rounds)} of {ROUNDS}")

    # pieces

    def _run(self, state: StudyState) -> Identification:
        run = self.runs[len(state.rows)]
        run.search = replace(self.search, max_seconds=state.budget_s)
        return run

    def _budget(self, state: StudyState) -> float | None:
        """The next identification's part of the time that is left, by its unknowns."""
        if self.search.max_seconds is None:
            return None
        weights = self._weights[len(state.rows) :]
        # never nothing: the physical guess at least is flown
        return max(self.search.max_seconds - state.wall_s, 1e-9) * weights[0] / sum(weights)

    def _row(self, state: StudyState, *, judged: bool) -> StudyRow:
        run, checkpoint = self._run(state), state.search or b""
        return study_row(run, run.judged(checkpoint) if judged else run.best_so_far(checkpoint))

    @cached_property
    def _weights(self) -> tuple[int, ...]:
        """What each identification costs, relative to the others: the flights of one difference quotient."""
        return tuple(1 + run.space.dimension for run in self.runs)

    def _timing(self, rows: Sequence[StudyRow]) -> FlightTiming:
        if self._prepared is None:
            first = self.runs[0]
            rigid = first.chain(first.model.aircraft, first.model.flight, 1)
            models: list[Flyable | None] = [(rigid, physical_guess(rigid))]
            models += [
                (run.model, row.batch) if row.flown else None
                for run, row in zip(self.runs, rows, strict=True)
            ]
            # the rigid model has no joints that could ask for a shorter step than another model's
            own_steps = [
                float(row.model["step_s"]) if row.model else run.step_s
                for run, row in zip(self.runs, rows, strict=True)
            ]
            self._prepared = flight_timing(
                models,
                [sample for sample in first.samples if sample.role == "train"],
                steps_s=[max(own_steps), *own_steps],
                start=first.settings.start,
                clock=self._clock,
            )
        return self._prepared

    def _fraction(self, state: StudyState) -> float:
        if state.phase == "done":
            return 1.0
        done = float(sum(self._weights[: len(state.rows)]))
        if len(state.rows) < len(self.links):
            done += state.share * self._weights[len(state.rows)]
        timed = len(state.rounds) / ROUNDS
        return (1.0 - TIMING_FRACTION) * done / sum(self._weights) + TIMING_FRACTION * timed

    def _reported(self, phase: str, state: StudyState, message: str) -> Step:
        return Step(phase, state.generation, 0.0, state.best_cost, state.flights, message, b"")

    def _result(self, state: StudyState, *, judged: bool) -> StudyResult:
        rows = state.rows
        times: list[float | None] = [None] * (1 + len(self.links))
        if state.rounds:
            times = [*medians(state.rounds)]
        rows = tuple(row.timed(t) for row, t in zip(rows, times[1:], strict=False))
        if state.search is not None:
            rows = (*rows, self._row(state, judged=judged))
        return study_result(
            rows,
            rigid_flight_s=times[0],
            plan_s=state.plan_s,
            rounds=len(state.rounds),
            search={
                "aero_coefficients": both_spellings(self.runs[0].first_corrections),
                "method": self.search.method,
                "seed": self.search.seed,
                "flights": state.flights,
                "generations": state.generation,
                "wall_s": state.wall_s,
                "finished": state.phase == "done",
            },
        )


def study(
    aircraft: AircraftDocument,
    flight: FlightDocument,
    samples: Sequence[Trajectory],
    *,
    links: Sequence[LinksPerWing] = LINKS,
    model: SearchedModel | None = None,
    search: Search | None = None,
    measurement: Measurement | None = None,
) -> StudyResult:
    """Study several numbers of links per wing, from start to end.

    Parameters
    ----------
    aircraft : Aircraft
        The aircraft.
    flight : Flight
        Its flight condition.
    samples : sequence of Trajectory
        Sample flights, angles in rad; those with role "held_out" are not fitted, and decide what is
        recommended.
    links : sequence of int or mapping of str to int
        Numbers of links per wing, each of all flexible surfaces or by name.
    model : SearchedModel, optional
        What the models have in common: bounds, lattice, time step.
    search : Search, optional
        Method and effort of each search.
    measurement : Measurement, optional
        How the samples were measured; what is left out is decided from the data.

    Returns
    -------
    StudyResult
        One row for each number of links, and the one that is recommended.

    Raises
    ------
    InvalidInput
        The samples or settings make no sense.
    NotFlyable
        No model was found that flies the samples.

    Examples
    --------
    >>> result = study(aircraft, flight, samples, links=(1, 2, 3))  # doctest: +SKIP
    >>> result.recommended.links_per_wing  # doctest: +SKIP
    2
    """
    run = Study(
        Aircraft.of(aircraft),
        Flight.of(flight),
        samples,
        links=links,
        model=model,
        search=search_settings(search or Search()),
        measurement=measurement,
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def study_from_request(request: StudyRequest, threads: int | None = None) -> Study:
    """The study that a request (the body of ``POST /study``) asks for.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    return Study(
        *flown_inputs(request),
        links=request.model.links_per_wing,
        model=request.model,
        search=search_settings(request.search),
        measurement=request.measurement,
    )


def _of_links(model: SearchedModel, links: LinksPerWing) -> EquivalentModel:
    return EquivalentModel(**{**dict(model), "links_per_wing": links})


def _found(row: StudyRow) -> str:
    J = "diverged" if row.J_train is None else f"J = {row.J_train:.3g} rad^2"
    return J if row.J_held_out is None else f"{J}, {row.J_held_out:.3g} on the flights held out"
