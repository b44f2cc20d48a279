"""Request and result of POST /export, and the JSON file of a model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Document, Identifier, Result, Text
from morphdata.execution import Request
from morphdata.faults import Fault
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.formats import FORMATS
from morphdata.options import OUTPUT, VEHICLE, Option
from morphdata.parameters import EXAMPLE_PARAMETERS, KnownModel, Parameters, flown_with
from morphdata.vehicle import model_surfaces_faults, sliding_faults, start_faults, trim_drive_faults
from morphdata.version import VERSION

MAX_FITS = 1000
if TYPE_CHECKING:
    FormatName = str
else:  # type checkers cannot use choices from a list
    FormatName = Literal[tuple(each.name for each in FORMATS)]

NOTICE = "Equivalent model of a morphing aircraft, identified and written by MorphID."

EXAMPLE_EXPORT: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "model": {"parameters": EXAMPLE_PARAMETERS},
    "format": "npz",
}


class Origin(Document):
    """Origin of a model, included in the exported file."""

    id: Identifier | None = Field(default=None, description="Of the identified model at its service.")
    fit: Annotated[list[dict[str, Any]], Field(max_length=MAX_FITS)] = Field(
        default=[], description="The `fit` of the identification's result."
    )
    verdict: dict[str, Any] | None = Field(
        default=None, description="The `verdict` of the identification's result."
    )


class ExportRequest(Request):
    """Aircraft, flight condition, an identified model, and the format of the file."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_EXPORT]})

    aircraft: Annotated[Aircraft, Option("--aircraft", VEHICLE)] = Field(description="Aircraft.")
    flight: Annotated[Flight, Option("--flight", VEHICLE)] = Field(
        description="Flight condition, also for the reference trim."
    )
    model: KnownModel
    format: Annotated[FormatName, Option("--format", OUTPUT)] = Field(description="Format of the file.")
    origin: Origin | None = None

    def faults(self) -> Iterator[Fault]:
        """Check that the flight has the requested start, and that the model belongs to this aircraft."""
        yield from start_faults(self.flight, flown_with(self.model).start)
        yield from trim_drive_faults(self.aircraft, self.flight)
        yield from sliding_faults(self.aircraft, self.flight, flown_with(self.model).lattice)
        yield from model_surfaces_faults(self.aircraft, self.model.known, "/model/parameters")


class ExportCost(Result):
    """Estimated cost of an export, to an order of magnitude."""

    core_s: float = Field(description="Computing time on one core.")


class ExportResult(Result):
    """The file of an export; it is among the job's artifacts."""

    format: str
    file: str = Field(description="Its name among the artifacts.", examples=["model.npz"])
    media_type: str
    size_bytes: int
    sha256: str = Field(description="Digest of its bytes, hexadecimal.")


class ModelFile(Document):
    """The export format `json`: all data needed to fly a model again.

    Examples
    --------
    >>> saved = ModelFile.load("model.json")  # doctest: +SKIP
    >>> saved.aircraft, saved.flight, saved.model  # doctest: +SKIP
    """

    aircraft: Aircraft
    flight: Flight
    model: Parameters
    origin: Origin = Field(default_factory=Origin)
    notice: Text = NOTICE
    morphid_version: Text = VERSION
