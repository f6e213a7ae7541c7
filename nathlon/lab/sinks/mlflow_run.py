"""A night as a run of MLflow, and whom it sends as a version in its registry."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from mlflow import MlflowClient
from mlflow.entities import Run
from mlflow.exceptions import MlflowException, RestException

from nathlon.lab.sinks.bulletin import Bulletin, Promotion
from nathlon.lab.sinks.figures import figures
from nathlon.results.summary import read_summary
from nathlon.selection.publish.output import REPORT, SUMMARY
from nathlon.selection.publish.sent import SENT, copy_policy
from nathlon.sim.names import file_stem

EXPERIMENT = "nathlon"
KEY, ENTRANT = "nathlon.key", "nathlon.entrant"
"""Tags: what a run is of, and whose policy a version is."""
LAST, CHAMPION = "sent", "champion"
"""Aliases: whom the last night has sent, and who has passed the gate last."""


def log_night(bulletin: Bulletin, address: str) -> str:
    """Log a night, or log it again into its run; the run's name and id.

    Args:
        bulletin: the night.
        address: of the tracking server.
    """
    assert bulletin.folder is not None
    client = MlflowClient(address, address)
    summary = read_summary(bulletin.folder / SUMMARY)
    run = _run(client, bulletin.key, str(bulletin.night))
    number = run.info.run_id
    client.set_tag(number, "mlflow.note.content", "\n\n".join([bulletin.headline, *bulletin.sentences]))
    facts = {"circuit": bulletin.circuit, "car": bulletin.car, "world": bulletin.world, "seed": summary.seed}
    for name, fact in (facts | {f"version {key}": text for key, text in summary.versions.items()}).items():
        client.log_param(number, name, fact)
    for name, value in figures(bulletin).items():
        client.log_metric(number, name, value)
    client.log_artifact(number, str(bulletin.folder / SUMMARY))
    client.log_artifacts(number, str(bulletin.folder / REPORT), REPORT)
    if any(one.path for one in bulletin.sent):
        client.log_artifacts(number, str(bulletin.folder / SENT), SENT)
        for one in bulletin.sent:
            version = _version(client, bulletin.place, one.entrant, run)
            client.set_registered_model_alias(_model(bulletin.place), LAST, version)
    client.set_terminated(number)
    return f"run {bulletin.night} ({number})"


def promote(promotion: Promotion, address: str) -> str:
    """Give the alias `champion` to whom the gate has passed; which version has it now.

    Args:
        promotion: whom, with its file for where no night has registered it.
        address: of the tracking server.
    """
    client = MlflowClient(address, address)
    model = _model(promotion.place)
    found = client.search_model_versions(_query(promotion.place, promotion.entrant))
    if found:
        version = str(found[0].version)
    else:
        run = _run(client, f"gate-{promotion.entrant}", f"gate {promotion.name}")
        with TemporaryDirectory() as folder:
            copy_policy(promotion.source, Path(folder) / promotion.source.name)
            client.log_artifacts(run.info.run_id, folder, SENT)
        version = _version(client, promotion.place, promotion.entrant, run)
        client.set_terminated(run.info.run_id)
    client.set_registered_model_alias(model, CHAMPION, version)
    return f"{model}@{CHAMPION} is version {version}"


def _run(client: MlflowClient, key: str, name: str) -> Run:
    """The run of something, which was made before or is new."""
    experiment = client.get_experiment_by_name(EXPERIMENT)
    number = experiment.experiment_id if experiment else client.create_experiment(EXPERIMENT)
    found = client.search_runs([number], f"tags.`{KEY}` = '{key}'", max_results=1)
    return found[0] if found else client.create_run(number, tags={KEY: key}, run_name=name)


def _version(client: MlflowClient, place: str, entrant: str, run: Run) -> str:
    """The version of a policy in the registry, which was made before or is new."""
    try:
        client.create_registered_model(_model(place))
    except (MlflowException, RestException) as error:
        if error.error_code != "RESOURCE_ALREADY_EXISTS":
            raise
    found = client.search_model_versions(_query(place, entrant))
    if found:
        return str(found[0].version)
    source = f"{run.info.artifact_uri}/{SENT}"
    tags = {ENTRANT: entrant}
    return str(client.create_model_version(_model(place), source, run.info.run_id, tags=tags).version)


def _model(place: str) -> str:
    return f"nathlon-{file_stem(place)}"


def _query(place: str, entrant: str) -> str:
    return f"name = '{_model(place)}' and tags.`{ENTRANT}` = '{entrant}'"
