"""Groups of commands, none of which takes an argument that is empty."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from nathlon.sim.errors import InputError

PANELS = ("Select", "Judge", "Look", "Train", "Files", "Commands")
"""Headings of a list of commands, in their order."""
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

    def list_commands(self, ctx: Any) -> list[str]:
        """In the order in which they were added, groups among commands."""
        return sorted(super().list_commands(ctx), key=lambda name: PANELS.index(self._panel(ctx, name)))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Commands by what they are for, each with its whole first sentence."""
        for panel, names in groupby(self.list_commands(ctx), lambda name: self._panel(ctx, name)):
            with formatter.section(panel):
                formatter.write_dl(
                    [(name, self._command(ctx, name).get_short_help_str(200)) for name in names]
                )

    def _command(self, ctx: Any, name: str) -> Any:
        return self.get_command(ctx, name)

    def _panel(self, ctx: Any, name: str) -> str:
        panel = self._command(ctx, name).rich_help_panel
        return panel if panel in PANELS else PANELS[-1]


def _refuse_empty(command: TyperCommand | TyperGroup, ctx: Any, args: list[str]) -> None:
    """Raise InputError for an empty argument, which a shell makes of a variable that is not set."""
    given, _, _ = command.make_parser(ctx).parse_args(args=list(args))
    for parameter in command.get_params(ctx):
        value = given.get(parameter.name or "")
        values = value if isinstance(value, list | tuple) else [value]
        if "" in values and parameter.metavar != NAMES:
            name = parameter.opts[0]
            raise InputError(f"{name}: is empty, expected a value; is a variable of the shell not set?")


class CommandGroup(typer.Typer):
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

    def add(self, panel: str, *commands: Callable[..., Any], **groups: CommandGroup) -> None:
        """Add commands, and groups by their names, below a heading of `PANELS`."""
        for command in commands:
            self.command(rich_help_panel=panel)(command)
        for name, group in groups.items():
            self.add_typer(group, name=name, rich_help_panel=panel)
