"""`nathlon observation`."""

from __future__ import annotations

from typing import Annotated

import typer

from nathlon.commands.options import AsJson
from nathlon.terminal import print_json


def observation(
    course_points: Annotated[int, typer.Option(help="Points on each line of the course.")] = 60,
    version: Annotated[
        int,
        typer.Option(
            min=2,
            max=4,
            help="Version of the layout; 3 is for policies of any car and circuit, 4 sees a plan.",
        ),
    ] = 2,
    as_json: AsJson = False,
) -> None:
    """Print the layout of the observations that a policy gets."""
    from nathlon.sim.observation import ObservationSpec

    spec = ObservationSpec(course_points=course_points, version=version)
    if as_json:
        fields = [{"name": field.name, "size": field.size, "unit": field.unit} for field in spec.fields]
        print_json({"version": spec.version, "size": spec.size, "fields": fields})
    else:
        print(spec.describe())
