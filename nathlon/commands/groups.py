"""Groups of commands, none of which takes an argument that is empty."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from nathlon.sim.errors import InputError

NAMES = "NAME,.."
"""Shown for an option with names and commas between; there may be none."""


class _Command(TyperCommand):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        _refuse_empty(self, ctx, args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except (EOFError, BrokenPipeError) as error:
            # Of a process of ours. typer would take it for the end of what is typed or read, and exit with 1.
            raise RuntimeError(f"{type(error).__name__} {error}") from error


class _Group(TyperGroup):
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        _refuse_empty(self, ctx, args)
        return super().parse_args(ctx, args)


def _refuse_empty(command: TyperCommand | TyperGroup, ctx: Any, args: list[str]) -> None:
    """Raise InputError for an empty argument, which a shell makes of a variable that is not set."""
    given, _, _ = command.make_parser(ctx).parse_args(args=list(args))
    for parameter in command.get_params(ctx):
        value = given.get(parameter.name or "")
        values = value if isinstance(value, list | tuple) else [value]
        if "" in values and parameter.metavar != NAMES:
            name = parameter.opts[0]
            raise InputError(f"{name}: is empty, expected a value; is a variable of the shell not set?")


class Group(typer.Typer):
    """Commands that go together.

    Args:
        about: what they are for.
    """

    def __init__(self, about: str) -> None:
        super().__init__(
            help=about,
            cls=_Group,
            no_args_is_help=True,
            add_completion=False,
            pretty_exceptions_enable=False,
            rich_markup_mode=None,  # rich takes longer to load than the help to read
        )

    def command(self, name: str | None = None, **options: Any) -> Callable[..., Any]:
        """See `typer.Typer.command`."""
        return super().command(name, cls=_Command, **options)
