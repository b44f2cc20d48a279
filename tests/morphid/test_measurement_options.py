"""What is known about a measurement stands on the command line: a file of channels, and flags."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from morphdata.identify import IdentifyRequest
from morphdata.study import StudyRequest
from morphid.commands.fields import FieldOption, field_options


def options(request: type[IdentifyRequest | StudyRequest]) -> dict[str, FieldOption]:
    """The options of a measurement by their flags."""
    return {
        option.flag: option for option in field_options(request) if option.pointer.startswith("/measurement/")
    }


@pytest.mark.parametrize("request_type", [IdentifyRequest, StudyRequest])
def test_every_field_of_a_measurement_has_its_option(
    request_type: type[IdentifyRequest | StudyRequest], tmp_path: Path
) -> None:
    """Channels are read from a file; what is decided from the data can be switched on and off."""
    found = options(request_type)
    assert {"--channels", "--bias", "--delay", "--initial-state", "--loss"} <= set(found)
    channels = {"theta": {"sigma": 5e-4}, "q": {}}
    path = tmp_path / "channels.json"
    path.write_text(json.dumps(channels), encoding="utf-8")
    assert found["--channels"].read(path) == channels
    for flag in ("--bias", "--delay", "--initial-state"):
        annotation = found[flag].parameter.annotation
        # inside of Annotated, typer keeps the first declaration where a default would stand
        assert annotation.__metadata__[0].default == f"{flag}/--no-{flag[2:]}"
