"""A night as a run of Weights & Biases."""

from __future__ import annotations

import wandb

from nathlon.lab.sinks.bulletin import PICTURE, Bulletin
from nathlon.lab.sinks.figures import COLUMNS, figures
from nathlon.results.summary import read_summary
from nathlon.selection.publish.output import REPORT, SUMMARY
from nathlon.selection.publish.sent import SENT
from nathlon.sim.names import file_stem


def log_night(bulletin: Bulletin, address: str) -> str:
    """Log a night, or log it again into its run; the run's address, or its folder where it is offline.

    Args:
        bulletin: the night.
        address: `PROJECT` or `ENTITY/PROJECT`.
    """
    assert bulletin.folder is not None
    summary = read_summary(bulletin.folder / SUMMARY)
    entity, _, project = address.rpartition("/")
    run = wandb.init(
        entity=entity or None,
        project=project,
        id=bulletin.key,
        name=bulletin.night,
        resume="allow",
        job_type="night",
        dir=bulletin.folder.parent,
        notes=" ".join([bulletin.headline, *bulletin.sentences]),
        config={"circuit": bulletin.circuit, "car": bulletin.car, "world": bulletin.world}
        | {"seed": summary.seed, "versions": summary.versions},
    )
    rows = [[getattr(row, column) for column in COLUMNS] for row in bulletin.ranking]
    table = wandb.Table(columns=list(COLUMNS), data=rows)
    run.log({"ranking": table, "picture": wandb.Image(str(bulletin.folder / PICTURE))})
    run.summary.update(figures(bulletin) | {"verdict": bulletin.headline})
    report = wandb.Artifact(f"report-{bulletin.key}", "report")
    report.add_file(str(bulletin.folder / SUMMARY))
    report.add_dir(str(bulletin.folder / REPORT), REPORT)
    run.log_artifact(report)
    if any(one.path for one in bulletin.sent):
        names = {one.name: one.digest for one in bulletin.sent}
        policy = wandb.Artifact(file_stem(f"sent-{bulletin.place}"), "model", metadata=names)
        policy.add_dir(str(bulletin.folder / SENT))
        run.log_artifact(policy, aliases=[str(bulletin.night)])
    run.finish()
    return run.url or run.dir
