"""Marks the fields of a request that are options of its command."""

from __future__ import annotations

from dataclasses import dataclass

# groups of options in a command's help, in their order
VEHICLE = "Aircraft and flights"
SCHEDULE = "Schedule and air"
MORPH = "Morph"
LIMITS = "Limits"
MODEL = "Model"
MEASUREMENT = "Measurement"
SEARCH = "Search"
UNCERTAINTY = "Uncertainty"
OUTPUT = "Execution and output"


@dataclass(frozen=True, slots=True)
class Option:
    """Marks a field as an option of the command; its help, type, choices and limits are the field's.

    Numbers, texts, choices and flags are written as they are; the items of a list are separated by commas, as
    are the values of an object of numbers (``--weights 1,1,1``); a larger object is a JSON file.

    Attributes
    ----------
    flag : str
        ``--links``.
    group : str
        Heading in the command's help.
    """

    flag: str
    group: str
