"""How the flights of an identification were measured: channels, their noise, biases, delays and outliers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Literal

from pydantic import Field

from morphdata.base import Document, Result
from morphdata.channels import is_channel
from morphdata.faults import Fault
from morphdata.options import MEASUREMENT, Option

ANGLES = ("phi", "theta", "psi")
ANGLE_COLUMNS = tuple(f"{name}_rad" for name in ANGLES)  # as files and documents call them
# they start anew with every simulated flight, or say nothing that the drives cause
UNFITTED = ("vx", "vy", "x", "y", "z", "hinge_torque", "drive_force")
MAX_CHANNELS = 64

Loss = Literal["linear", "huber", "soft_l1"]


class MeasuredChannel(Document):
    """How one channel was measured; what is left out is found out from the data."""

    sigma: Annotated[float, Field(gt=0.0, le=1e6)] | None = Field(
        default=None,
        description="Standard deviation of the channel's noise, SI units and rad. Left out: estimated from "
        "the data, and again from the residuals of the fit.",
    )
    bias: bool | None = Field(
        default=None, description="Whether the channel may have a constant bias. Left out: as `bias` says."
    )


class Measurement(Document):
    """How the sample flights were measured; what is left out is decided from the data.

    A reading is y(t) = h(x(t - delay)) + bias + noise. A flight counts as measured where its angles carry
    white noise above 2e-5 rad: then biases and the delay are free. In flights without noise they are freed
    where that lowers the squared errors at least tenfold. The heading to begin with is always free.
    """

    channels: Annotated[
        dict[str, MeasuredChannel] | None, Option("--channels", MEASUREMENT), Field(max_length=MAX_CHANNELS)
    ] = Field(
        default=None,
        description="The channels to fit, each divided by its sigma: `phi`, `theta`, `psi`, `p`, `q`, `r`, "
        "`alpha`, `tip_left_z`, ... Left out: the three angles with equal weights.",
    )
    bias: Annotated[bool | None, Option("--bias", MEASUREMENT)] = Field(
        default=None, description="Whether channels may have a constant bias in each flight."
    )
    delay: Annotated[bool | None, Option("--delay", MEASUREMENT)] = Field(
        default=None, description="Whether all channels of a flight may be late against its drives."
    )
    initial_state: Annotated[bool | None, Option("--initial-state", MEASUREMENT)] = Field(
        default=None, description="Whether a flight may begin with attitude, rates and speed off its trim."
    )
    loss: Annotated[Loss, Option("--loss", MEASUREMENT)] = Field(
        default="linear",
        description="What a residual costs: its square, or less than that where it is large, so that "
        "outliers hardly count.",
    )
    drive_bandwidth_hz: Annotated[float, Field(gt=0.0, le=1e4)] | Literal["auto"] | None = Field(
        default=None,
        description="Bandwidth to which histories of drives are smoothed before they are differentiated; "
        "`auto` or left out: chosen from the data.",
    )

    def faults(self) -> Iterator[Fault]:
        """Check that every channel is one that can be fitted."""
        for name in self.channels or {}:
            if name not in ANGLES and not is_channel(name):
                yield Fault(
                    "unknown_channel",
                    f"There is no channel {name}.",
                    f"/channels/{name}",
                    "Channels are phi, theta, psi and those of simulated flights: p, q, r, tip_left_z, ...",
                )
            elif name in UNFITTED or name.startswith(("hinge_torque_", "drive_force_")):
                yield Fault(
                    "channel_not_fitted",
                    f"The channel {name} cannot be fitted.",
                    f"/channels/{name}",
                    "Leave it out; attitude, rates, air data, specific force and tips can be.",
                )
        if self.channels is not None and not self.channels:
            yield Fault(
                "too_short", "There is no channel to fit.", "/channels", "Name one, or leave channels out."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The channels that are fitted."""
        return ANGLES if self.channels is None else tuple(self.channels)


def absent_channels(
    measurement: Measurement | None, samples: Iterable[tuple[str, str, Sequence[str]]]
) -> Iterator[Fault]:
    """Check that every sample to fit brings the channels that are fitted.

    Parameters
    ----------
    measurement : Measurement, optional
    samples : of (pointer, role, names of its channels).
    """
    wanted = () if measurement is None else measurement.names
    for pointer, role, present in samples:
        for name in wanted:
            if role == "train" and name not in ANGLES and name not in present:
                yield Fault(
                    "channel_missing",
                    f"The sample has no column {name}, which measurement.channels names.",
                    pointer,
                    f"Add the column, or leave {name} out of measurement.channels.",
                )


class Estimate(Result):
    """An estimated value."""

    value: float
    standard_error: float | None = Field(default=None, description="null where it is not finite.")


class SampleMeasurement(Result):
    """What was found out about the measurement of one sample."""

    bias: dict[str, Estimate] = Field(
        default={},
        description="Reading minus truth of each channel whose bias was free. Of `psi`, bias and heading to "
        "begin with cannot be told apart: it is their sum, as in `heading_rad`.",
    )
    delay_s: Estimate | None = Field(
        default=None,
        description="How late all channels are against the drives; null where that was not free.",
    )
    heading_rad: Estimate | None = Field(
        default=None, description="Heading to begin with, as the readings say."
    )
    initial_state: dict[str, Estimate] = Field(
        default={}, description="What the start is off its trim, where that was free; SI units and rad."
    )
    first_angle_rad: dict[str, Estimate] = Field(
        default={},
        description="Of each noisy drive, what the angle for which a flight is trimmed is off its first "
        "smoothed angle.",
    )
    sigma: dict[str, float] = Field(
        default={}, description="Noise of each channel by which its residuals were divided."
    )
    noise_rad: dict[str, float] = Field(
        default={}, description="White noise that the rows of each angle carry, from their third differences."
    )
    reason: str | None = Field(default=None, description="Why biases, delay or start were free or not.")
