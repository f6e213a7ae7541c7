"""What a selection will cost and can find, said before it runs."""

from __future__ import annotations

from nathlon.results.part import ResultModel
from nathlon.results.words import an_episode, counted, episodes


class StageForecast(ResultModel):
    """What is expected of a stage.

    Attributes:
        name: as in `nathlon.results.summary.Stage`.
        entrants: that come in.
        races: expected.
        most_races: that the configuration allows so many entrants.
        core_s: processor time, s; None where no earlier selection tells.
    """

    name: str
    entrants: int
    races: int
    most_races: int
    core_s: float | None


class Budget(ResultModel):
    """What the round robin finds with so many units.

    Attributes:
        pairs: units of evidence of every matchup, at most.
        races: that these are.
        effect: least true difference, points a race, that is found with the probability `power`.
    """

    pairs: int
    races: int
    effect: float


class Forecast(ResultModel):
    """What a selection will cost and can find.

    Attributes:
        newcomers: checkpoints to be judged.
        earlier: selections that it rests on; 0 where it rests on the figures of `docs/plan.md`.
        workers: processes.
        stages: in their order.
        deviation: of the difference of two entrants from one unit to the next, points a race; None in another
            world of which no earlier selection tells.
        power: probability to find a difference of the size that is said to be found.
        budgets: what the round robin finds as configured, and with more; empty where nobody meets, or without
            a deviation.
        episode: what its users call one.
        episode_s: what an episode of random policies took here, s; None where none was played.
    """

    newcomers: int
    earlier: int
    workers: int
    stages: tuple[StageForecast, ...]
    deviation: float | None
    power: float
    budgets: tuple[Budget, ...]
    episode: str = "race"
    episode_s: float | None = None

    @property
    def meets(self) -> bool:
        """Whether entrants are expected to meet."""
        return any(stage.races for stage in self.stages if stage.name == "tournament")

    @property
    def races(self) -> int:
        """Expected in all."""
        return sum(stage.races for stage in self.stages)

    @property
    def most_races(self) -> int:
        """Allowed in all."""
        return sum(stage.most_races for stage in self.stages)

    @property
    def core_hours(self) -> float | None:
        """Processor time of all stages, h; None where that of one is not known."""
        times = [stage.core_s for stage in self.stages]
        return None if None in times else sum(time for time in times if time is not None) / 3600

    @property
    def hours(self) -> float | None:
        """Until the verdict with all workers, h."""
        return None if self.core_hours is None else self.core_hours / self.workers


def _duration(hours: float) -> str:
    seconds = 3600 * hours
    if seconds < 1:
        return "less than 1 s"
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if hours < 1 else f"{hours:.1f} h"


def sentences(forecast: Forecast) -> list[str]:
    """What it comes to, for people."""
    one, several = an_episode(forecast.episode), episodes(forecast.episode)
    workers = counted(forecast.workers, "worker")
    cost = "" if forecast.hours is None else f", {_duration(forecast.hours)} with {workers}"
    many = f"{forecast.newcomers:,} checkpoint{' needs' if forecast.newcomers == 1 else 's need'}"
    said = [f"{many} about {forecast.races:,} {several}{cost}."]
    if forecast.budgets:
        said.append(
            f"Two finalists that differ by {forecast.budgets[0].effect:.1f} points {one} are told apart in "
            f"{100 * forecast.power:.0f} of 100 selections."
        )
    elif forecast.meets:
        said.append("What differences it finds is said once a selection in this world has been held.")
    if not forecast.meets:
        said.append("Nobody is expected to meet, so that there is no round robin.")
    if forecast.earlier:
        said.append(f"This rests on earlier selections in the store: {forecast.earlier}.")
    elif forecast.episode_s is not None:
        said.append(
            f"There is no earlier selection in the store. {one.capitalize()} of random policies took "
            f"{forecast.episode_s:.3g} s here; how many {several} are needed rests on the bundled ladders."
        )
    else:
        said.append("There is no earlier selection in the store; this rests on those of the bundled ladders.")
    return said
