"""The service's settings for a command: its options, then the environment, then the defaults."""

from __future__ import annotations

from typing import TYPE_CHECKING

from morphid.exits import CommandError, Exit
from morphid.screen import stderr

if TYPE_CHECKING:
    from app.settings import Settings


def settings_for(**given: object) -> Settings:
    """Read the settings; warn about variables whose names resemble a setting.

    Parameters
    ----------
    given : options by the setting's name; None where the user gave none.
    """
    from app.settings import UnsafeSettings, doubtful_variables, load_settings

    for sentence in doubtful_variables():
        stderr().print(f"warning: {sentence}", style="yellow", markup=False, soft_wrap=True)
    try:
        return load_settings(**given)
    except UnsafeSettings as error:
        raise CommandError(str(error), code=Exit.USAGE) from None
