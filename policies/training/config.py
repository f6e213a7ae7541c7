"""What a training run is made of, as a TOML file says it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainSerializer,
    PlainValidator,
    model_validator,
)

from nathlon.policies.checkpoint import ANY, Practises
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.training.coached import CoachedStart
from nathlon.policies.training.rewards import RewardWeights
from nathlon.policies.vision import Vision
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.data_file import Section, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.observation import PLAN_PACE, ObservationSpec
from nathlon.sim.scenario import Delay, Rate

Count = Annotated[int, Field(ge=1, le=10**12)]
Deviation = Annotated[float, Field(gt=0, le=1)]
Cars = Annotated[int, Field(ge=1, le=20)]
Patience = Annotated[float, Field(gt=0, le=600)]

CONFIGS = Path(__file__).parent / "configs"
"""The configurations that come with nathlon."""

SELF, PAST = "self", "past"
"""Opponents: the policy in training, and one of its checkpoints so far."""


class Opponent(Section):
    """One that may drive the cars that the learner does not.

    Attributes:
        policy: a built-in driver or the path of a checkpoint, see nathlon.policies.load; or `self`, `past`.
        weight: how often it is drawn, relative to the others.
    """

    policy: str
    weight: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0


def _named(value: Any) -> Any:
    return {"policy": value} if isinstance(value, str) else value


def _somebody_at_first(opponents: tuple[Opponent, ...]) -> tuple[Opponent, ...]:
    if opponents and all(opponent.policy in (SELF, PAST) for opponent in opponents):
        raise ValueError("expected one besides self and past, to stand in for them at first")
    return opponents


Opponents = Annotated[
    tuple[Annotated[Opponent, BeforeValidator(_named)], ...], AfterValidator(_somebody_at_first)
]


class Rollouts(Section):
    """Races of one scenario that run side by side.

    Attributes:
        scenario: name of a shipped one, or path.
        races: how many, in each world.
        worlds: how many worlds; of a variety each has another pair of circuit and car.
        learners: cars a race that the learner drives and learns from.
        places: their starting places, 1 is the first; without it they are spread from the last.
        opponents: who drive the others, each car drawn anew at each start; without any, those of the run.
        share: of each minibatch that comes from these races.
        mistakes: share of the starts, once there are any, from shortly before a learner's loss of control.
        patience_s: of imitation, instead of that of the run.
        demonstrators: policies that drive the learner's cars in its place, in turn, so that it learns from
            what they do; see nathlon.policies.load.
        perception_delay_s: instead of the scenario's, for all cars or for each place.
        racer: of imitation, instead of that of the run; `champion` races at home, at full pace.
        wear_rate, fuel_rate: instead of the scenario's; so high ones that tyres and tank are soon in every
            state of a long race.
    """

    scenario: str
    races: Annotated[int, Field(ge=1, le=10_000)]
    worlds: Annotated[int, Field(ge=1, le=1000)] = 1
    learners: Cars
    places: tuple[Cars, ...] | None = None
    opponents: Opponents = ()
    share: Annotated[float, Field(gt=0, le=1)] | None = None
    mistakes: Annotated[float, Field(ge=0, le=1)] = 0.0
    patience_s: Annotated[Patience | None, Field(exclude_if=lambda patience: patience is None)] = None
    demonstrators: tuple[str, ...] = ()
    perception_delay_s: Delay | tuple[Delay, ...] | None = None
    racer: Annotated[str | None, Field(exclude_if=lambda racer: racer is None)] = None
    wear_rate: Rate | None = None
    fuel_rate: Rate | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Rollouts:
        if self.places is not None and len(set(self.places)) != self.learners:
            raise ValueError(f"places must be {self.learners} different ones, one for each of the learners")
        return self


class Variety(Section):
    """Pairs of circuit and car without end, which the rollouts drive in turn.

    Attributes:
        pairs: how many generated circuits, each with a generated car of its own.
        first_seed: of the first circuit and car.
        home: whether the circuits and cars that come with nathlon are among them, each with each.
        slippery: share of the generated ones whose road is wet or worse.
        loose: share of these whose ground is loose, so that tyres peak at a larger slip, and flatter.
        shipped: share of the generated circuits on which a car that comes with nathlon drives instead.
        held_out: further generated pairs, on which checkpoints are evaluated.
        stint_s: simulated time, s, that a world of the rollouts stays with a pair.
    """

    pairs: Annotated[int, Field(ge=1, le=100_000)]
    first_seed: Annotated[int, Field(ge=0, le=2**40)] = 0
    home: bool = True
    slippery: Annotated[float, Field(ge=0, le=1)] = 0.2
    loose: Annotated[float, Field(ge=0, le=1)] = 0.0
    shipped: Annotated[float, Field(ge=0, le=1)] = 0.0
    held_out: Annotated[int, Field(ge=1, le=100)] = 6
    stint_s: Annotated[float, Field(gt=0, le=1e6)] = 120.0


class PolishSettings(Section):
    """How fast polishing moves; see `nathlon.policies.training.polish`.

    Attributes:
        rate: of Adam at first; it falls by half a cosine to a twentieth.
        batch: steps of cars in a minibatch.
        deviation: of the noise on pedals and steering.
        teacher: policy that is imitated where cars are lost, such as `driver`; then rewards do not count.
    """

    rate: Annotated[float, Field(gt=0, le=1)] = 5e-5
    batch: Count = 8192
    deviation: tuple[Deviation, Deviation] = (0.04, 0.015)
    teacher: str | None = None


class ImitationSettings(Section):
    """Learning from a teacher alone; see `nathlon.policies.training.imitation`.

    Attributes:
        teacher: policy that is imitated.
        paces: shares of its speed at which the built-in driver drives, in turn, whatever it teaches, unless
            its name says a pace; the policy in training is shown the plan's speeds likewise.
        rounds: into which the updates of the run are divided; each begins with driving.
        length_s: driven in a round by each car.
        taught: share of the cars that the teacher drives in the first rounds; none from then on.
        patience_s: for how long a car may be out of control before its race is started anew; without it, no
            race is.
        rescuer: policy that is imitated instead where a car faces away from the road or is stranded beside
            it, such as `driver`.
        racer: policy that is imitated instead where another car is near, such as `driver:rollout=4` or the
            path of a checkpoint.
        racer_every: steps after which a car asks a racer that remembers nothing again; of those between,
            nothing is learnt.
        disturbance: deviation of what is added to pedals and steering of every second car, half a second
            long, so that the policy is told what to do beside its way; less by the grip of a slippery pair.
        mirrored: whether it learns the mirror image of half of what is said.
        passage: steps of a car that are learnt from together, where the policy sees by a camera.
        recalled: of these, the first ones, which only bring the memory up to date.
        telling: weight of the error with which it tells, while it learns, what the teacher sees.
    """

    teacher: str = "driver"
    paces: Annotated[tuple[Annotated[float, Field(ge=0.5, le=1.0)], ...], Field(min_length=1)] = (1.0,)
    rounds: Annotated[int, Field(ge=1, le=10_000)] = 30
    length_s: Annotated[float, Field(gt=0, le=600)] = 25.0
    taught: tuple[Annotated[float, Field(ge=0, le=1)], ...] = (1.0, 0.5, 0.25, 0.1)
    patience_s: Patience | None = None
    rescuer: Annotated[str | None, Field(exclude_if=lambda rescuer: rescuer is None)] = None
    racer: Annotated[str | None, Field(exclude_if=lambda racer: racer is None)] = None
    disturbance: Annotated[float, Field(ge=0, le=1, exclude_if=lambda deviation: not deviation)] = 0.0
    mirrored: Annotated[bool, Field(exclude_if=lambda mirrored: not mirrored)] = False
    racer_every: Annotated[int, Field(ge=1, le=100, exclude_if=lambda every: every == 1)] = 1
    passage: Annotated[int, Field(ge=1, le=1000)] = 16
    recalled: Annotated[int, Field(ge=0, le=1000)] = 4
    telling: Annotated[float, Field(ge=0, le=100)] = 0.1

    @model_validator(mode="after")
    def _learns_from_the_rest(self) -> ImitationSettings:
        if self.recalled >= self.passage:
            raise ValueError(f"recalled is {self.recalled}, expected less than passage, {self.passage}")
        return self


def _camera(value: Any) -> CameraSpec:
    try:
        return value if isinstance(value, CameraSpec) else CameraSpec.from_dict(value)
    except InputError as error:
        raise ValueError(str(error)) from None


Camera = Annotated[CameraSpec, PlainValidator(_camera), PlainSerializer(CameraSpec.to_dict)]


class ObservationSettings(Section):
    """The observation spec to train on; see nathlon.sim.observation."""

    course_points: Annotated[int, Field(ge=0, le=500)] = 60
    horizon_s: Annotated[float, Field(gt=0, le=60)] = 6.0
    cars_ahead: Annotated[int, Field(ge=0, le=500)] = 4
    cars_behind: Annotated[int, Field(ge=0, le=500)] = 4
    version: Literal[2, 3, 4] = 2
    plan_pace: Annotated[float, Field(ge=0.5, le=1.5)] = PLAN_PACE
    walls: bool = False
    camera: Annotated[Camera | None, Field(exclude_if=lambda camera: camera is None)] = None

    def spec(self) -> ObservationSpec:
        """The spec itself."""
        return replace(self.critic_spec(), camera=self.camera) if self.camera else self.critic_spec()

    def critic_spec(self) -> ObservationSpec:
        """What critics see instead: the numbers where the policy sees by a camera, else the same."""
        return ObservationSpec(**self.model_dump(exclude={"camera"}))


class TrainingConfig(Section):
    """A training run.

    Attributes:
        circuit, car: what is driven; `any` where there is a variety.
        variety: of circuits and cars, instead of one of each.
        updates: gradient updates of the whole run.
        updates_per_step: updates after each step of all rollouts.
        warm_up: transitions to gather before the first update.
        replay: transitions to remember.
        checkpoint_every: updates between checkpoints.
        opponents: of the rollouts that name none of their own.
        coached: start states of races of one car, see `nathlon.policies.training.coached`.
        workers: processes that step all the rollouts while the learner updates; 0 takes turns in one process,
            which is exactly reproducible. Polishing and imitation share their trials among them.
        refresh_every: updates between the policies that the rollouts are given.
        tables: one replay table for each of the rollouts, or one for all.
        practises: whether its checkpoints practise a circuit before they race there; in training they see the
            driver's plan.
        vision: of a policy that sees by a camera; its critics see the numbers that it does not.
        imitation: if given, the policy learns from a teacher instead of rewards.
        keep_replay: whether a stop keeps the replay tables too, so that going on needs no warm-up.
    """

    circuit: str = ANY
    car: str = ANY
    variety: Variety | None = None
    updates: Count
    updates_per_step: Annotated[int, Field(ge=1, le=100_000)]
    warm_up: Count
    replay: Count
    checkpoint_every: Count
    workers: Annotated[int, Field(ge=0, le=64)] = 0
    refresh_every: Count = 1
    tables: Literal["each", "one"] = "each"
    keep_replay: bool = False
    opponents: Opponents = ()
    coached: tuple[CoachedStart, ...] = ()
    rollouts: Annotated[tuple[Rollouts, ...], Field(min_length=1)]
    observation: ObservationSettings = ObservationSettings()
    practises: Practises = False
    vision: Annotated[Vision | None, Field(exclude_if=lambda vision: vision is None)] = None
    qrsac: QRSACConfig = QRSACConfig()
    reward: RewardWeights = RewardWeights()
    polish: PolishSettings = PolishSettings()
    imitation: ImitationSettings | None = None

    @property
    def shares(self) -> tuple[float, ...]:
        """Of each minibatch, by rollouts; they add up to 1."""
        given = [rollouts.share or 1.0 for rollouts in self.rollouts]
        return tuple(share / sum(given) for share in given)

    @model_validator(mode="after")
    def _one_or_many(self) -> TrainingConfig:
        for name in ("circuit", "car"):
            if (getattr(self, name) == ANY) != (self.variety is not None):
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected one, or a variety")
        if self.coached and self.variety is not None:
            raise ValueError("coached is given, which is of one circuit, expected no variety beside it")
        return self

    @model_validator(mode="after")
    def _sees_as_it_observes(self) -> TrainingConfig:
        camera = self.observation.camera
        if (self.vision is None) != (camera is None):
            raise ValueError("vision and observation.camera belong together, expected both or neither")
        if self.vision is None or camera is None:
            return self
        if self.keep_replay:
            raise ValueError("keep_replay is true, expected false beside a vision")
        if self.qrsac.encoder:
            raise ValueError("qrsac.encoder is given, expected none beside a vision")
        if self.imitation is not None and self.imitation.racer_every > 1:
            # Passages have no gaps.
            raise ValueError("imitation.racer_every is given, expected none beside a vision")
        if self.imitation is not None and self.imitation.mirrored:
            # Pictures would have to be turned round as well.
            raise ValueError("imitation.mirrored is given, expected none beside a vision")
        self.vision.shapes(camera, 0)  # raises where nothing is left of the pictures
        return self

    @model_validator(mode="after")
    def _has_what_to_practise(self) -> TrainingConfig:
        if self.practises and not self.observation.critic_spec().planned:
            raise ValueError("practises is given, expected observation.version 4 beside it")
        return self

    @model_validator(mode="after")
    def _lessons_are_of_an_imitation(self) -> TrainingConfig:
        for rollouts in self.rollouts:
            for name in ("racer", "patience_s"):
                if getattr(rollouts, name) is not None and self.imitation is None:
                    raise ValueError(
                        f"rollouts {rollouts.scenario}: {name} is given, expected an imitation beside it"
                    )
        return self

    @model_validator(mode="after")
    def _shares_add_up(self) -> TrainingConfig:
        given = [rollouts.share for rollouts in self.rollouts if rollouts.share is not None]
        if given and len(given) < len(self.rollouts):
            raise ValueError("share must be given for all rollouts or for none")
        if given and abs(sum(given) - 1.0) > 1e-6:
            raise ValueError(f"the shares of the rollouts add up to {sum(given):g}, expected 1")
        return self

    @model_validator(mode="after")
    def _warm_up_fits(self) -> TrainingConfig:
        if self.warm_up > self.replay:
            raise ValueError("warm_up must not be larger than replay")
        return self


def read_config(path: Path) -> TrainingConfig:
    """Read and check a training configuration.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    return read_toml(path, TrainingConfig, "training configuration")
