"""MorphID's numeric library: equivalent models of sweep-morphing aircraft from sample flights.

The functions ``identify``, ``simulate`` and ``export`` share their names with the packages that hold them and
take precedence: import from inside such a package by ``from morphcore.identify.settings import ...``.
"""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING

_collecting = gc.isenabled()
gc.disable()  # the imports create no garbage, and collecting it would take a twentieth of their time
try:
    from morphcore.export.formats import export
    from morphcore.identify import identification_from_request, identify
    from morphcore.late import late_names
    from morphcore.simulate.flight import Simulation, simulate
    from morphcore.simulate.trajectory import Trajectory, load_trajectory
    from morphcore.warming import warm_up, warm_up_further
    from morphdata.aircraft import Aircraft, load_aircraft
    from morphdata.flight import Flight, load_flight
    from morphdata.version import VERSION
finally:
    if not gc.get_freeze_count():
        gc.freeze()
        gc.unfreeze()  # what was imported goes to the oldest generation without a look at each object
    if _collecting:
        gc.enable()

if TYPE_CHECKING:
    from morphcore.identify import Identification, IdentifyResult
    from morphcore.identify.study import study
    from morphcore.optimise import optimise_schedule

__version__ = VERSION

__getattr__ = late_names(
    __name__,
    {
        "Identification": "morphcore.identify",
        "IdentifyResult": "morphcore.identify",
        "optimise_schedule": "morphcore.optimise",
        "study": "morphcore.identify.study",
    },
)

__all__ = [
    "Aircraft",
    "Flight",
    "Identification",
    "IdentifyResult",
    "Simulation",
    "Trajectory",
    "__version__",
    "export",
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
