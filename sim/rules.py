"""Rules of a race: what counts as an offence and what it costs; data files, and the kernels' view."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from nathlon.sim.data_file import DATA, Name, Section, find_data, read_toml

Positive = Annotated[float, Field(gt=0, le=1e4)]
NotNegative = Annotated[float, Field(ge=0, le=1e4)]
"""Seconds, metres, m/s: of none can a race use more."""


class TrackLimits(Section):
    """Leaving the course."""

    warnings: Annotated[int, Field(ge=0, le=1_000_000)]
    shortest_s: NotNegative
    excused_s: NotNegative
    penalty_s: NotNegative


class Cutting(Section):
    """Leaving it to save way."""

    gain_m: NotNegative
    penalty_s: NotNegative


class Contact(Section):
    """Running into others."""

    light_m_s: NotNegative
    heavy_m_s: NotNegative
    clear_m_s: NotNegative
    rear_end_s: NotNegative
    side_swipe_s: NotNegative

    @model_validator(mode="after")
    def _rising(self) -> Contact:
        if self.heavy_m_s < self.light_m_s:
            raise ValueError("heavy_m_s must not lie below light_m_s")
        return self


class Serving(Section):
    """How penalties are served."""

    speed_m_s: Positive


class BlueFlags(Section):
    """Letting those by that lap one."""

    shown_s: Positive
    close_s: Positive
    patience_s: Positive
    penalty_s: NotNegative

    @model_validator(mode="after")
    def _close_is_in_sight(self) -> BlueFlags:
        if self.close_s > self.shown_s:
            raise ValueError("close_s must not lie above shown_s")
        return self


class Pit(Section):
    """What a stop takes; see `nathlon.sim.physics.pit_lane`."""

    tyres_s: NotNegative = 8.0
    fuel_kg_s: Positive = 2.5
    together: bool = False


class Rules(Section):
    """Rules as their file describes them; see `sim/data/rules/blue_flags.toml` for each field."""

    name: Name
    description: str
    limits: TrackLimits
    cutting: Cutting
    contact: Contact
    serving: Serving
    blue_flags: BlueFlags | None = None
    pit: Pit = Pit()


class PitParameters(NamedTuple):
    """What the kernels read of a stop; s and kg/s."""

    tyres: float
    fuel_rate: float
    together: bool


class BlueFlagParameters(NamedTuple):
    """What the kernels read of the rules on blue flags; s."""

    shown: float
    close: float
    patience: float
    penalty: float


class RuleParameters(NamedTuple):
    """What the kernels read of the rules; s, m and m/s."""

    warnings: int
    shortest: float
    excused: float
    limits_penalty: float
    cut_gain: float
    cut_penalty: float
    light: float
    heavy: float
    clear: float
    rear_end_penalty: float
    side_swipe_penalty: float
    serving_speed: float
    pit: PitParameters


def rule_parameters(rules: Rules) -> RuleParameters:
    """The kernels' view of the rules."""
    limits, cutting, contact = rules.limits, rules.cutting, rules.contact
    return RuleParameters(
        warnings=limits.warnings,
        shortest=limits.shortest_s,
        excused=limits.excused_s,
        limits_penalty=limits.penalty_s,
        cut_gain=cutting.gain_m,
        cut_penalty=cutting.penalty_s,
        light=contact.light_m_s,
        heavy=contact.heavy_m_s,
        clear=contact.clear_m_s,
        rear_end_penalty=contact.rear_end_s,
        side_swipe_penalty=contact.side_swipe_s,
        serving_speed=rules.serving.speed_m_s,
        pit=PitParameters(rules.pit.tyres_s, rules.pit.fuel_kg_s, rules.pit.together),
    )


def blue_flag_parameters(rules: Rules) -> BlueFlagParameters | None:
    """The kernels' view of the rules on blue flags; None where none are shown."""
    flags = rules.blue_flags
    if flags is None:
        return None
    return BlueFlagParameters(flags.shown_s, flags.close_s, flags.patience_s, flags.penalty_s)


@lru_cache
def load_rules(name: str) -> Rules:
    """Rules by their shipped name, or by the path of a `.toml` file.

    Raises:
        InputError: if there are no such rules or their file is wrong.
    """
    return read_toml(find_data(name, "rules", DATA / "rules"), Rules, "rules")
