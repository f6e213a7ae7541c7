"""Which settings a matrix goes through, and what counts as worse in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from nathlon.selection.battery.measures import MEASURES, OWN
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.data_file import Named, Section
from nathlon.sim.scenario import Blur, Delay, Hertz, Noise
from nathlon.sim.validation import check_distinct

Margin = Annotated[float, Field(ge=0, le=1e6)]
Levels = Annotated[tuple[Named, ...], Field(max_length=200)]


MARGINS: Mapping[str, float] = {
    "pace": 0.005,
    "place": 0.5,
    "off_course": 0.5,
    "at_fault": 0.25,
    "stopped": 0.02,
}


class MatrixSettings(Section):
    """The section `matrix` of the configuration.

    Attributes:
        circuits, cars: by name or folder; the configuration's where there are none.
        scenarios: by name or path.
        compounds: tyres of all cars; the scenario's own where there are none.
        delays_s: with which all cars see, s.
        rates_hz: actions a second of all cars; the scenario's own where there are none.
        blurs, noises: before all cameras, see `nathlon.sim.camera_spec`; for policies that see by one.
        places: starting places of the policy and of the baseline, as far as the scenario has them.
        opponents: who start from the other places, in turn; the world's baseline where there are none.
        margins: measures (`nathlon.selection.battery.measures.MEASURES`), and by how much of each the policy
            may be worse: a share of the baseline's mark where that is a time, a way or a speed, and in the
            measure's unit otherwise.
        runs: of each cell in the screening.
        confirm: cells, those that look worst, that are driven again on other starts.
        most_runs: of a cell that is driven again, and goes on to look worse.
        false_discovery_rate: the share, to be expected, of cells called worse that are not.
        replays: cells that got worse whose worst run leaves recordings.
    """

    circuits: Levels = ()
    cars: Levels = ()
    scenarios: Annotated[tuple[str, ...], Field(min_length=1, max_length=200)] = (
        "sprint",
        "standing_start",
        "following",
        "slipstream_pass",
        "braking_duel",
        "chicane_in_traffic",
        "defending",
    )
    compounds: Levels = ()
    delays_s: Annotated[tuple[Delay, ...], Field(min_length=1, max_length=20)] = (0.0, 0.1)
    rates_hz: Annotated[tuple[Hertz, ...], Field(max_length=20)] = ()
    blurs: Annotated[tuple[Blur, ...], Field(min_length=1, max_length=20)] = (0,)
    noises: Annotated[tuple[Noise, ...], Field(min_length=1, max_length=20)] = (0.0,)
    places: Annotated[tuple[Annotated[int, Field(ge=1, le=1000)], ...], Field(min_length=1)] = (1, 2, 4, 8)
    opponents: Levels = ()
    margins: Annotated[Mapping[str, Margin], Field(min_length=1)] = MARGINS
    runs: Annotated[int, Field(ge=2, le=1000)] = 4
    confirm: Annotated[int, Field(ge=0, le=100_000)] = 200
    most_runs: Annotated[int, Field(ge=8, le=10_000)] = 128
    false_discovery_rate: Annotated[float, Field(ge=0.001, le=0.5)] = 0.05
    replays: Annotated[int, Field(ge=0, le=100)] = 6

    @model_validator(mode="after")
    def _distinct(self) -> MatrixSettings:
        check_distinct(
            circuits=self.circuits,
            cars=self.cars,
            scenarios=self.scenarios,
            compounds=self.compounds,
            delays_s=[round(delay * DYNAMICS_HZ) / DYNAMICS_HZ for delay in self.delays_s],
            rates_hz=self.rates_hz,
            blurs=self.blurs,
            noises=self.noises,
            places=self.places,
        )
        return self

    @model_validator(mode="after")
    def _known(self) -> MatrixSettings:
        for name in self.margins:
            if name not in MEASURES and not name.startswith(OWN):
                raise ValueError(f"margins has {name!r}: expected some of {', '.join(MEASURES)}")
        return self
