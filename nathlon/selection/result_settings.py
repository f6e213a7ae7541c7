"""Where the results of a night go besides its folder."""

from __future__ import annotations

from nathlon.sim.data_file import Named, Section


class ResultSettings(Section):
    """The section `results` of the configuration; each sink gets every night that is told.

    `$NAME` as a value is that variable of the environment, which is where addresses with a secret belong.

    Attributes:
        wandb: project of Weights & Biases: `PROJECT` or `ENTITY/PROJECT`.
        mlflow: address of the tracking server: `https://HOST`, or `sqlite:///PATH`.
        tensorboard: folder of event files.
        webhook: address that gets JSON.
        slack: incoming webhook of Slack, or of a chat that takes its messages.
        teams: incoming webhook of Microsoft Teams.
        mail: addresses with commas between.
        link: where the folder `out` is served, for links to report and picture.
    """

    wandb: Named | None = None
    mlflow: Named | None = None
    tensorboard: Named | None = None
    webhook: Named | None = None
    slack: Named | None = None
    teams: Named | None = None
    mail: Named | None = None
    link: Named | None = None

    @property
    def sinks(self) -> dict[str, str]:
        """What was asked for: addresses by the sink's name."""
        return self.model_dump(exclude={"link"}, exclude_none=True)
