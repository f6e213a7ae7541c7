"""The numbers that QR-SAC is trained with."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

PASSAGE, RECALLED = 16, 4
"""Steps of a passage, and of these the first ones, unless a configuration says otherwise."""
Width = Annotated[int, Field(ge=1, le=8192)]


class QRSACConfig(BaseModel):
    """Hyperparameters of QR-SAC.

    The defaults are those of Wurman et al. (Nature 602, 2022), but for `hidden`: theirs is four of 2,048.

    Attributes:
        hidden: units of each hidden layer, of the policy and of each critic.
        encoder: units of each layer, with ReLU, that what does not change in a race goes through before it
            joins the rest of an observation; of the policy and of each critic. Empty for none.
        quantiles: quantiles of the return that each critic estimates.
        layer_norm: whether the critics standardise each hidden layer before its ReLU (Ba et al., 2016,
            without learned scale and shift); it keeps values bounded where there are no data, so that
            higher rates learn (not in the reference).
        distributional: False estimates the mean return by least squares instead, with one output a
            critic: plain SAC.
        n_step: steps of a full transition (the replay buffer cuts them).
        gamma: discount a step.
        alpha: weight of the entropy bonus; tied to the scale of the reward.
        critic_rate: Adam's learning rate of the critics.
        policy_rate: Adam's learning rate of the policy.
        policy_waits: updates at first in which the critics alone learn, for a policy that has learnt before.
        final_rates: share of both learning rates that is left at the end of a run; they fall by half a
            cosine (not in the reference).
        final_alpha: the same of alpha.
        polyak: share of the critics that is mixed into their targets after each update.
        averaging: share of the policy that is mixed into its running mean after each update (1 is no mean).
            Checkpoints hold the mean, which swings less from one to the next (not in the reference).
        gradient_norm: greatest norm of the gradient of both critics together.
        dropout: share of the policy's hidden units dropped in the pass that updates the policy.
        batch: transitions an update.
        passage: steps of a run that are learnt from together, where the policy remembers or does not see what
            its critics see.
        recalled: of these, the first ones, which only bring the memory up to date.
        precision: of the hidden layers' matrix products, all else is float32 in any case; `auto` takes
            bfloat16 where the processor has instructions for it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    hidden: Annotated[tuple[Width, ...], Field(min_length=1, max_length=8)] = (256, 256)
    encoder: Annotated[tuple[Width, ...], Field(max_length=4)] = ()
    quantiles: Annotated[int, Field(ge=1, le=512)] = 32
    layer_norm: bool = False
    distributional: bool = True
    n_step: Annotated[int, Field(ge=1, le=100)] = 7
    gamma: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9896
    alpha: Annotated[float, Field(ge=0.0)] = 0.01
    critic_rate: Annotated[float, Field(gt=0.0, le=1.0)] = 5e-5
    policy_rate: Annotated[float, Field(gt=0.0, le=1.0)] = 2.5e-5
    policy_waits: Annotated[int, Field(ge=0, exclude_if=lambda updates: not updates)] = 0
    final_rates: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    final_alpha: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    polyak: Annotated[float, Field(gt=0.0, le=1.0)] = 0.005
    averaging: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    gradient_norm: Annotated[float, Field(gt=0.0)] = 10.0
    dropout: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1
    batch: Annotated[int, Field(ge=1, le=1_000_000)] = 1024
    passage: Annotated[int, Field(ge=1, le=1000, exclude_if=lambda steps: steps == PASSAGE)] = PASSAGE
    recalled: Annotated[int, Field(ge=0, le=1000, exclude_if=lambda steps: steps == RECALLED)] = RECALLED
    precision: Literal["auto", "float32", "bfloat16"] = "auto"

    @model_validator(mode="after")
    def _learns_from_the_rest(self) -> QRSACConfig:
        if self.recalled >= self.passage:
            raise ValueError(f"recalled is {self.recalled}, expected less than passage, {self.passage}")
        return self
