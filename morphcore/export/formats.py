"""Export of an identified model; each format has one function that writes it.

A format is an entry of ``morphdata/formats.py`` and one module here with the function that the entry names.
The data available to all formats, computed once, are an `ExportedModel`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from morphcore.errors import InvalidInput
from morphcore.export.model_tables import Tables, model_tables, reference_trim
from morphcore.geometry import aircraft as resolved
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, fitted
from morphcore.models.parameters_document import parameter_batch, parameters_document
from morphcore.shown import Shown
from morphcore.simulate.trim import StartMode, Trim
from morphdata.aircraft import Aircraft
from morphdata.export import ExportRequest, ModelFile, Origin
from morphdata.flight import Flight
from morphdata.formats import FORMATS, ExportFormat, format_named
from morphdata.parameters import Parameters, WholeResult, flown_with

if TYPE_CHECKING:
    from morphcore.identify.result import IdentifyResult

Document = dict[str, Any]
Given: TypeAlias = "IdentifyResult | ParameterBatch | Parameters | WholeResult | Document"
Write = Callable[["ExportedModel"], bytes]


@dataclass(frozen=True, repr=False)
class ExportedModel(Shown):
    """The data that the file of a model can contain.

    Attributes
    ----------
    file : ModelFile
        Aircraft, flight, parameters and origin as documents.
    chain : ChainModel
        The model's links and lattice, with all surfaces.
    batch : ParameterBatch
        Its single parameter set, by surface.
    start : {"trim", "given"}
        Source of the reference trim.
    """

    file: ModelFile
    chain: ChainModel
    batch: ParameterBatch
    start: StartMode

    @classmethod
    def of(cls, request: ExportRequest) -> ExportedModel:
        """Return the exported model of a request.

        Raises
        ------
        InvalidInput
            The model is given by an id, which only a service can resolve, or belongs to another aircraft.
        """
        known, flown = request.model.known, flown_with(request.model)
        if known is None:
            raise InvalidInput(
                "a model id can only be resolved by the service",
                pointer="/model/model_id",
                hint="give the model's parameters instead",
            )
        aircraft, flight = resolved.Aircraft.of(request.aircraft), resolved.Flight.of(request.flight)
        chain = chain_model(aircraft, flight, known.links_per_wing, flown.lattice)
        parameters = known.model_copy(
            update={"lattice": flown.lattice, "step_s": flown.step_s, "start": flown.start}
        )
        file = ModelFile(
            aircraft=request.aircraft,
            flight=request.flight,
            model=parameters,
            origin=request.origin or Origin(),
        )
        return cls(file, chain, fitted(chain, parameter_batch(known)), flown.start)

    @cached_property
    def trim(self) -> Trim:
        """The steady flight with the hinges at their held angles, or the flight's given start.

        Raises
        ------
        TrimNotFound
            There is none.
        """
        return reference_trim(self.chain, self.batch, self.start)

    @cached_property
    def tables(self) -> Tables:
        """Arrays of parameters, links, joints, hinges and trim: see `morphcore.export.model_tables`."""
        return model_tables(self.file, self.chain, self.batch, self.trim)


class Export:
    """One file of one model, written when its bytes are first requested.

    Parameters
    ----------
    request : ExportRequest
        Model, aircraft, flight and format.

    Raises
    ------
    InvalidInput
        As in `ExportedModel.of`.
    """

    def __init__(self, request: ExportRequest) -> None:
        self.format: ExportFormat = format_named(request.format)
        self.model = ExportedModel.of(request)
        self._data: bytes | None = None

    def data(self) -> bytes:
        """Return the file's bytes; the same model gives the same bytes.

        Raises
        ------
        TrimNotFound
            The format holds the reference trim, and there is none.
        """
        if self._data is None:
            module, _, name = self.format.write.partition(":")
            write: Write = getattr(import_module(module), name)
            self._data = write(self.model)
        return self._data

    def to_document(self) -> Document:
        """JSON form with the names of the API."""
        return {
            "format": self.format.name,
            "file": self.format.file,
            "media_type": self.format.media_type,
            "size_bytes": len(self.data()),
            "sha256": hashlib.sha256(self.data()).hexdigest(),
        }


def export(
    model: Given,
    aircraft: Aircraft,
    flight: Flight,
    format: str,  # noqa: A002 - the name of the option and of the field
    path: str | Path,
    *,
    origin: Origin | None = None,
) -> Path:
    """Write an identified model as a file for other programs.

    Parameters
    ----------
    model : IdentifyResult, ParameterBatch, Parameters, WholeResult or dict
        The result of an identification, one parameter set (`physical_guess` too), or the document of either.
    aircraft : Aircraft
        The aircraft that the model belongs to.
    flight : Flight
        The flight condition, also for the reference trim.
    format : str
        A name of `morphdata.formats.FORMATS`: "npz", "mat", "json".
    path : str or Path
        The file; it is replaced if it exists.
    origin : Origin, optional
        Where the model comes from; for a result, its fit is the default.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InvalidInput
        There is no such format, or the model belongs to another aircraft.
    TrimNotFound
        The format holds the reference trim, and there is none.

    Examples
    --------
    >>> from morphcore import export, load_aircraft, load_flight
    >>> aircraft = load_aircraft("examples/aircraft.json")
    >>> flight = load_flight("examples/flight.json")
    >>> export(json.load(open("out.json")), aircraft, flight, "npz", "model.npz")  # doctest: +SKIP
    PosixPath('model.npz')
    """
    if not any(each.name == format for each in FORMATS):
        raise InvalidInput(
            f"there is no format {format!r}",
            pointer="/format",
            hint=f"the formats are {', '.join(each.name for each in FORMATS)}",
        )
    parameters, found = _given(model)
    request = ExportRequest.parse(
        {
            "aircraft": aircraft,
            "flight": flight,
            "model": {"parameters": parameters},
            "format": format,
            "origin": origin or found,
        }
    )
    path = Path(path)
    path.write_bytes(Export(request).data())
    return path


def _given(model: Given) -> tuple[Any, Origin | None]:
    """The parameters in the form of a request, and what is known of their origin."""
    if not isinstance(model, ParameterBatch | Parameters | WholeResult | dict):
        model = model.to_document()
    if isinstance(model, ParameterBatch):
        return parameters_document(model), None
    if isinstance(model, WholeResult):
        return model, Origin(fit=model.fit or [])
    if isinstance(model, dict) and "model" in model:
        return model, Origin(fit=model.get("fit") or [], verdict=model.get("verdict"))
    return model, None
