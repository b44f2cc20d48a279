"""Verification: flights of the compared schedules in the flexible model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import FlightDiverged, TrimNotFound
from morphcore.optimise.case import MorphCase
from morphcore.optimise.flights import SAMPLE_S
from morphcore.search.checkpoint import stored
from morphcore.search.run import Clock
from morphcore.simulate.flight import flight_steps
from morphcore.simulate.schedule import Schedule
from morphcore.stopping import Stop
from morphcore.threads import one_blas_thread
from morphcore.validity import documents
from morphdata.optimize import VerifyingModel

Array = NDArray[np.float64]

SHOWN_SHARE = 0.02  # fraction of a flight between progress reports


@stored
@dataclass(frozen=True)
class Verified:
    """One schedule's flight in the flexible model.

    euler : (k, 3) rad at the rows of the window; empty if the flight failed, as ``failure`` explains.
    warnings : of the flight, as documents.
    """

    schedule: str
    euler: Array
    wall_s: float
    failure: str = ""
    warnings: tuple[dict[str, Any], ...] = ()


def verification(
    case: MorphCase,
    flexible: VerifyingModel,
    name: str,
    schedule: Schedule,
    clock: Clock,
    stop: Stop | None,
) -> Iterator[float | Verified]:
    """Fly one schedule; yield the completed fraction from time to time, and the record at the end.

    Raises
    ------
    Interrupted : ``stop`` returned True.
    """
    begin, shown = clock(), 0.0
    euler, failure = np.zeros((0, 3)), ""
    warnings: tuple[dict[str, Any], ...] = ()
    try:
        with one_blas_thread():
            for step in flight_steps(
                case.aircraft,
                case.flight,
                dict.fromkeys(case.drives, schedule),
                model="flexible",
                duration_s=float(case.times_s[-1]),
                output_step_s=SAMPLE_S,
                start=case.start,
                lattice=flexible.lattice or case.lattice,
                elements=flexible.elements,
                stop=stop,
            ):
                if step.simulation is not None:
                    euler = step.simulation.trajectory.euler
                    warnings = tuple(documents(step.simulation.warnings))
                elif step.fraction >= shown + SHOWN_SHARE:
                    shown = step.fraction
                    yield shown
    except (FlightDiverged, TrimNotFound) as error:
        failure = str(error)
    yield Verified(name, euler, clock() - begin, failure, warnings)
