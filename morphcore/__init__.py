"""MorphID's numeric library: equivalent models of sweep-morphing aircraft from sample flights.

The functions ``identify`` and ``simulate`` share their names with the rooms that hold them, and win: import
what lies inside a room by ``from morphcore.identify.settings import ...``.
"""

from __future__ import annotations

from morphcore.identify import Identification, IdentifyResult, identification_from_request, identify
from morphcore.identify.study import study
from morphcore.optimise import optimise_schedule
from morphcore.simulate.flight import Simulation, simulate
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.warming import warm_up, warm_up_further
from morphdata.aircraft import Aircraft, load_aircraft
from morphdata.flight import Flight, load_flight
from morphdata.version import VERSION

__version__ = VERSION

__all__ = [
    "Aircraft",
    "Flight",
    "Identification",
    "IdentifyResult",
    "Simulation",
    "Trajectory",
    "__version__",
    "identification_from_request",
    "identify",
    "load_aircraft",
    "load_flight",
    "load_trajectory",
    "optimise_schedule",
    "simulate",
    "study",
    "warm_up",
    "warm_up_further",
]
