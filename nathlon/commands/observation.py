"""`nathlon observation`."""

from __future__ import annotations

from nathlon.commands.console import print_json
from nathlon.sim.observation import ObservationSpec


def observation(course_points: int, as_json: bool) -> None:
    """Print the layout of the observations with so many points on each line of the course."""
    spec = ObservationSpec(course_points=course_points)
    if as_json:
        fields = [{"name": field.name, "size": field.size, "unit": field.unit} for field in spec.fields]
        print_json({"version": spec.version, "size": spec.size, "fields": fields})
    else:
        print(spec.describe())
