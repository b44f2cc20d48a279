"""MorphID's numeric library: equivalent models of sweep-morphing aircraft from sample flights.

>>> from morphcore import load_aircraft, load_flight, load_trajectory, identify  # doctest: +SKIP
"""

from __future__ import annotations

from morphcore.geometry.aircraft import Aircraft, Flight, load_aircraft, load_flight
from morphcore.identify import Identification, IdentifyResult, identification_from_document, identify
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.warm_up import warm_up

__all__ = [
    "Aircraft",
    "Flight",
    "Identification",
    "IdentifyResult",
    "Trajectory",
    "identification_from_document",
    "identify",
    "load_aircraft",
    "load_flight",
    "load_trajectory",
    "warm_up",
]
