"""The sinks by name; each is loaded when it is used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from nathlon.lab.sinks.bulletin import Bulletin, Promotion
from nathlon.lab.sinks.delivery import CHAMPION
from nathlon.lab.sinks.posting import mail, slack, teams, webhook
from nathlon.results.part import ResultModel
from nathlon.sim.extras import need


class Sink(NamedTuple):
    """Somewhere to deliver to.

    Attributes:
        takes: what it is told.
        deliver: delivers it to an address, and says where it is to be found; raises any error where it
            cannot.
    """

    takes: type[ResultModel]
    deliver: Callable[[Any, str], str]


def _wandb(bulletin: Bulletin, address: str) -> str:
    need("wandb", "wandb", "Weights & Biases")
    from nathlon.lab.sinks.wandb_run import log_night

    return log_night(bulletin, address)


def _mlflow(bulletin: Bulletin, address: str) -> str:
    need("mlflow", "mlflow", "MLflow")
    from nathlon.lab.sinks.mlflow_run import log_night

    return log_night(bulletin, address)


def _champion(promotion: Promotion, address: str) -> str:
    need("mlflow", "mlflow", "MLflow")
    from nathlon.lab.sinks.mlflow_run import promote

    return promote(promotion, address)


def _tensorboard(bulletin: Bulletin, address: str) -> str:
    need("torch", "train", "TensorBoard")
    from nathlon.lab.sinks.tensorboard_events import log_night

    return log_night(bulletin, address)


SINKS: Mapping[str, Sink] = {
    "wandb": Sink(Bulletin, _wandb),
    "mlflow": Sink(Bulletin, _mlflow),
    "tensorboard": Sink(Bulletin, _tensorboard),
    "webhook": Sink(Bulletin, webhook),
    "slack": Sink(Bulletin, slack),
    "teams": Sink(Bulletin, teams),
    "mail": Sink(Bulletin, mail),
    CHAMPION: Sink(Promotion, _champion),
}
