"""The choice of output channels in requests, and whether a flight can provide them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from morphdata.base import Document
from morphdata.channels import CHANNELS, channel_facts
from morphdata.faults import Fault

if TYPE_CHECKING:
    ChannelName = str
else:  # type checkers cannot use choices from a list
    ChannelName = Literal[tuple(each.name for each in CHANNELS)]

RequestedChannels = Annotated[
    list[ChannelName], Field(max_length=100, json_schema_extra={"uniqueItems": True})
]
CHANNELS_TEXT = (
    "Columns of the trajectory after time, attitude and hinge angles, in this order; those of the example "
    "flights when left out."
)


class ChannelChoice(Document):
    """The requested channels, for callers without a request document."""

    channels: RequestedChannels


def channels_faults(names: Sequence[str], model_kind: str, gravity_m_s2: float) -> Iterator[Fault]:
    """Check that each channel is requested once and that the flight can provide it; pointers are ``/0``."""
    for number, name in enumerate(names):
        facts = channel_facts(name)
        if name in names[:number]:
            yield Fault(
                "given_twice", f"The channel {name} is requested twice.", f"/{number}", "Leave one out."
            )
        elif model_kind not in facts.models:
            yield Fault(
                "channel_not_available",
                f"The {model_kind} model does not provide the channel {name}.",
                f"/{number}",
                f"Leave it out, or fly one of the models that provide it: {', '.join(facts.models)}.",
            )
        elif facts.needs_gravity and gravity_m_s2 == 0.0:
            yield Fault(
                "channel_not_available",
                f"The channel {name} is a multiple of the weight, and flight.gravity_m_s2 is 0.",
                f"/{number}",
                "Request the specific force (fx, fy, fz) instead.",
            )
