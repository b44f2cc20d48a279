"""Options with several values at once: ``--sample a.csv b.csv``, as a shell expands ``*.csv``."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from typer.core import TyperCommand

if TYPE_CHECKING:
    from typer._click.core import Context  # the base class's own, which has no public name


class SeveralValues(TyperCommand):
    """A command whose repeatable options take all words up to the next option.

    It must have no positional arguments: a word could be one.
    """

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        """Repeat the option before each further value, as the underlying parser requires."""
        repeatable = {
            name
            for parameter in self.params
            if getattr(parameter, "multiple", False)
            for name in parameter.opts
        }
        parsed: list[str] = super().parse_args(ctx, list(repeated(args, repeatable)))
        return parsed


def repeated(words: Sequence[str], options: Collection[str]) -> Iterator[str]:
    """Insert each of the `options` again before its second and every further value.

    >>> list(repeated(["--sample", "a", "b", "--seed", "1"], {"--sample"}))
    ['--sample', 'a', '--sample', 'b', '--seed', '1']
    """
    option, values = "", 0
    for position, word in enumerate(words):
        if word == "--":
            yield from words[position:]
            return
        if word.startswith("-") and word != "-":
            name, equals, _ = word.partition("=")
            option, values = (name, int(bool(equals))) if name in options else ("", 0)
        elif option:
            if values:
                yield option
            values += 1
        yield word
