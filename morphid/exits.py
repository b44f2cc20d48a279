"""Exit codes of the ``morphid`` command and the one error that carries them."""

from __future__ import annotations

from enum import IntEnum

from morphdata.faults import Pickled


class Exit(IntEnum):
    """Exit codes that shell scripts can rely on."""

    OK = 0
    FAILED = 1  # the job failed, or an unexpected error occurred
    USAGE = 2  # the command line itself was wrong (typer's own code)
    INVALID_INPUT = 3  # a file is missing or unreadable, or a value in it is refused
    STOPPED = 4  # the job was cancelled or ran out of time; a partial result may have been written
    UNREACHABLE = 5  # no service answers at the given address
    ENVIRONMENT = 6  # this machine lacks something: a free port, a program, a writable directory
    INTERRUPTED = 130  # Ctrl-C


class CommandError(Pickled, Exception):
    """A message for the user with its exit code.

    Parameters
    ----------
    message : what is wrong.
    code : exit code.
    hint : what to do about it.
    pointer : JSON pointer to the field at fault, "" if there is none.
    given_by : the option or file that set that field, "" if unknown.
    """

    def __init__(
        self,
        message: str,
        *,
        code: Exit = Exit.FAILED,
        hint: str = "",
        pointer: str = "",
        given_by: str = "",
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.hint = hint
        self.pointer = pointer
        self.given_by = given_by

    def to_document(self) -> dict[str, str | int]:
        """Return the error as the JSON that ``--json`` prints."""
        return {
            "error": self.message,
            "pointer": self.pointer,
            "hint": self.hint,
            "given_by": self.given_by,
            "exit_code": int(self.code),
        }
