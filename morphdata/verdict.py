"""The verdict on an identification and the statistics of its residuals, as they stand in results."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from morphdata.base import Result

Share = float | None


class Verdict(Result):
    """Whether an identified model may be believed."""

    grade: Literal["good", "usable", "poor", "failed"] = Field(
        description="`good`: flights that were held out are predicted to a hundredth of their motion, or "
        "several fitted flights are met so where none was held out. `usable`: to a twentieth, or something "
        "is doubtful. `poor`: worse, or the samples are wrong. `failed`: no model flies the fitted samples."
    )
    reasons: list[str] = Field(description="Sentences, the weightiest first.")
    next_steps: list[str] = Field(default=[], description="What to do about it, sentences.")


class ChannelStatistics(Result):
    """Statistics of a channel's residual over one sample; null where there is nothing to divide by."""

    theil: Share = Field(
        description="Theil's inequality coefficient of the departures from the start: 0 for a perfect model, "
        "1 for one that has nothing to do with the flight."
    )
    theil_bias: Share = Field(description="Part of the mean squared error that is an offset.")
    theil_variance: Share = Field(description="Part that is a motion of the wrong size.")
    theil_covariance: Share = Field(description="What is left; the three parts add up to 1.")
    lag_1: float | None = Field(description="Correlation of the residual from one row to the next.")
    ljung_box_p: Share = Field(
        description="Probability of so large an autocorrelation if the residual were white (Ljung & Box)."
    )
    white: bool | None = Field(
        description="Whether the residual may be taken for white: that probability is above 0.01, or no "
        "correlation exceeds 0.2."
    )
    drive_correlation: float | None = Field(
        description="Largest correlation, by size, of the residual with the angle or rate of a drive."
    )
