"""Sinks: where nights go besides their folders, and what becomes of a night whose sinks fail."""

from __future__ import annotations

import json
import shutil
import socketserver
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nathlon.api.candidates import named_sources
from nathlon.arena.decision import Decision
from nathlon.lab.sinks import delivery, messages, posting, telling
from nathlon.lab.sinks.bulletin import Bulletin, Promotion
from nathlon.lab.sinks.delivery import Delivery, deliver
from nathlon.lab.sinks.secrets import concealed, revealed
from nathlon.lab.sinks.telling import bulletin
from nathlon.policies.sources.identity import policy_id
from nathlon.results.gate import Gated, GateReport
from nathlon.results.summary import write_summary
from nathlon.selection.config import Config, read_config
from nathlon.selection.nightly.night import OK, Night
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon
from tests.support.scripted_model import answer, raw_model
from tests.support.selections import build

SECRET = "T0-B0-never-to-be-said"


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Bulletin:
    """A night that has left its folder."""
    out = tmp_path_factory.mktemp("nights")
    selection = build(np.random.default_rng(4), entrants=12, finalists=4)
    folder = out / "night-0007"
    for part in ("report", "sent"):
        (folder / part).mkdir(parents=True)
    (folder / "report" / "index.html").write_text("<p>the report</p>")
    shutil.copy(BUNDLED[0], folder / "sent")
    sent = [one.model_copy(update={"path": f"sent/{BUNDLED[0].name}"}) for one in selection.summary.sent]
    facts = {"sent": tuple(sent), "report": "report/index.html"}
    summary = selection.summary.model_copy(update=facts)
    write_summary(folder / "summary.json", summary)
    object.__setattr__(selection, "summary", summary)
    config = Config.model_validate({"out": str(out), "results": {"link": "https://nights.example/"}})
    return bulletin(Night(folder.name, "done", OK, "It is sent.", selection), config)


def bodies(heard: list[bytes]) -> list[Any]:
    return [json.loads(request[request.index(b"{") :]) for request in heard]


def test_a_webhook_gets_verdict_ranking_and_links(told: Bulletin) -> None:
    with raw_model(answer(200, "ok")) as (address, heard):
        assert posting.webhook(told, f"{address}/{SECRET}") == "127.0.0.1"
    [body] = bodies(heard)
    assert body["headline"].startswith("Send coast-")
    assert body["report"] == "https://nights.example/night-0007/report/index.html"
    assert body["picture"] == "https://nights.example/night-0007/report/ranking.png"
    assert [row["name"] for row in body["ranking"]] == [row.name for row in told.ranking]
    assert body["ranking"][0]["points_low"] < body["ranking"][0]["points_high"]
    assert "folder" not in body
    assert told.folder is not None
    assert (told.folder / "report" / "ranking.png").read_bytes().startswith(b"\x89PNG")


def test_slack_and_teams_get_verdict_picture_and_link_in_their_shapes(told: Bulletin) -> None:
    slack = messages.slack(told)
    assert [block["type"] for block in slack["blocks"]] == ["header", "section", "image", "actions"]
    assert told.headline in slack["text"]
    assert slack["blocks"][2]["image_url"] == told.picture
    assert slack["blocks"][3]["elements"][0]["url"] == told.report
    card = messages.teams(told)["attachments"][0]["content"]
    assert (card["type"], card["actions"][0]["url"], card["body"][2]["url"]) == (
        "AdaptiveCard",
        told.report,
        told.picture,
    )
    long = told.model_copy(update={"headline": "x" * 400, "report": None, "picture": None})
    assert len(messages.slack(long)["blocks"][0]["text"]["text"]) == messages.HEADER
    assert [block["type"] for block in messages.slack(long)["blocks"]] == ["header", "section"]


def test_a_refusal_is_one_sentence_without_the_secret(
    told: Bulletin, monkeypatch: pytest.MonkeyPatch
) -> None:
    with raw_model(answer(403, f"bad token {SECRET}")) as (address, _), pytest.raises(InputError) as caught:
        posting.slack(told, f"{address}/{SECRET}")
    assert str(caught.value) == "127.0.0.1 answers 403 Forbidden"
    with pytest.raises(InputError, match="begins with https://"):
        posting.slack(told, "ftp://host/x")
    monkeypatch.setenv("MY_TOKEN", SECRET)
    assert revealed("$MY_TOKEN") == SECRET
    said = concealed(
        f"no {SECRET}\nat https://me:pw@host/services/{SECRET}", f"https://host/services/{SECRET}"
    )
    assert said == "no *** at https://***@host/***"
    with pytest.raises(InputError, match="environment variable NOT_THERE is not set"):
        revealed("$NOT_THERE")


@pytest.mark.parametrize("password", ["pa#ss-word", "pa/ss-word", "pa?ss-word", "[pa-ss-word"])
def test_a_password_that_is_not_written_as_in_an_address_is_not_said(
    password: str, told: Bulletin, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(posting.SMTP, f"smtp://me:{password}@host:587")
    with pytest.raises(InputError, match="NATHLON_SMTP is not set to a mail server") as caught:
        posting.mail(told, "one@example.org")
    assert "pa" not in str(caught.value).replace("PASSWORD", "").replace("in a password", "")
    assert concealed(f"me:{password} and {password}", "one@example.org") == "*** and ***"


@contextmanager
def mail_server() -> Iterator[tuple[int, list[str]]]:
    """A server that takes letters without encryption; its port, and what it is told."""
    heard: list[str] = []

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(b"220 here\r\n")
            in_letter = False
            for line in self.rfile:
                said = line.decode().rstrip("\r\n")
                heard.append(said)
                if in_letter and said != ".":
                    continue
                in_letter = said.upper() == "DATA"
                if said.upper() == "QUIT":
                    self.wfile.write(b"221 bye\r\n")
                    return
                self.wfile.write(b"354 go on\r\n" if in_letter else b"250 well\r\n")

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        try:
            yield server.server_address[1], heard
        finally:
            server.shutdown()


def test_a_letter_has_verdict_and_ranking_and_no_password_goes_in_the_clear(
    told: Bulletin, monkeypatch: pytest.MonkeyPatch
) -> None:
    with mail_server() as (port, heard):
        monkeypatch.setenv(posting.SMTP, f"smtp://127.0.0.1:{port}")
        assert posting.mail(told, "one@example.org,two@example.org") == "one@example.org,two@example.org"
        assert "RCPT TO:<two@example.org>" in [line.replace("rcpt", "RCPT") for line in heard]
        assert any(line.startswith("Subject: nathlon night-0007: Send coast-") for line in heard)
        assert any(told.ranking[0].name in line for line in heard)
        monkeypatch.setenv(posting.SMTP, f"smtp://me:{SECRET}@127.0.0.1:{port}")
        with pytest.raises(InputError, match="no TLS, without which no password is sent"):
            posting.mail(told, "one@example.org")
    assert SECRET not in "".join(heard)
    monkeypatch.delenv(posting.SMTP)
    with pytest.raises(InputError, match="NATHLON_SMTP is not set"):
        posting.mail(told, "one@example.org")


def test_mlflow_has_a_run_a_night_and_its_champion_moves_when_a_gate_passes(
    told: Bulletin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mlflow = pytest.importorskip("mlflow")
    from nathlon.lab.sinks.mlflow_run import log_night, promote

    address = f"sqlite:///{tmp_path}/mlflow.db"
    mlflow.MlflowClient(address, address).create_experiment("nathlon", f"file:{tmp_path}/artefacts")
    place = log_night(told, address)
    assert log_night(told, address) == place, "a night that is told twice"
    client = mlflow.MlflowClient(address, address)
    [experiment] = [one for one in client.search_experiments() if one.name == "nathlon"]
    [run] = client.search_runs([experiment.experiment_id])
    assert run.data.metrics["points_per_race"] == pytest.approx(told.ranking[0].points_per_race)
    assert run.info.status == "FINISHED"
    paths = {one.path for one in client.list_artifacts(run.info.run_id)}
    assert paths == {"report", "sent", "summary.json"}
    sent = client.get_model_version_by_alias("nathlon-harbour-gt3", "sent")
    assert sent.tags["nathlon.entrant"] == told.sent[0].entrant
    for entrant, file in ((told.sent[0].entrant, BUNDLED[0]), ("b" * 64, BUNDLED[1])):
        promotion = Promotion(place="harbour-gt3", entrant=entrant, name="new", source=file)
        promote(promotion, address)
        assert promote(promotion, address).startswith("nathlon-harbour-gt3@champion is version ")
        champion = client.get_model_version_by_alias("nathlon-harbour-gt3", "champion")
        assert champion.tags["nathlon.entrant"] == entrant
        assert (Path(champion.source.removeprefix("file:").removeprefix("//")) / file.name).is_file()
    assert len(client.search_model_versions("name = 'nathlon-harbour-gt3'")) == 2

    # And back again: a champion is a source of checkpoints.
    monkeypatch.setenv("MLFLOW_TRACKING_URI", address)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    mlflow.set_tracking_uri(None)
    model = "mlflow:nathlon-harbour-gt3"
    for name, file in ((f"{model}@champion", BUNDLED[1]), (f"{model}/1", BUNDLED[0])):
        [path] = named_sources(name)
        assert Path(path).read_bytes() == file.read_bytes()
    [path] = named_sources(f"mlflow:runs/{run.info.run_id}")
    assert path.endswith(f"/sent/{BUNDLED[0].name}")
    with pytest.raises(InputError, match="mlflow:nathlon-harbour-gt3@nobody: cannot be fetched: "):
        named_sources(f"{model}@nobody")


def test_only_a_gate_that_passes_one_candidate_makes_a_champion(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []

    def deliver(*job: Any) -> tuple[()]:
        told.append(job)
        return ()

    monkeypatch.setattr(telling, "deliver", deliver)
    identity = policy_id(str(BUNDLED[0]))
    passed = Gated(name="new", entrant=identity, verdict=Decision.PASS, findings=())
    config = Config.model_validate({"results": {"mlflow": "https://mlflow.example"}})
    given = [str(path) for path in BUNDLED[:2]]
    for candidates in ((passed.model_copy(update={"verdict": Decision.FAIL}),), (passed, passed)):
        telling.tell_gate(gated(*candidates), given, config)
    telling.tell_gate(gated(passed), given, Config())
    assert told == []
    [lost] = telling.tell_gate(gated(passed), given[1:], config)
    assert lost.sentence == " Not delivered to champion: new is no file, or has changed since it was judged."
    telling.tell_gate(gated(passed), given, config)
    promotion = Promotion(place="lindenring-gt3", entrant=identity, name="new", source=BUNDLED[0])
    assert told == [(promotion, {"champion": "https://mlflow.example"})]


def gated(*candidates: Gated) -> GateReport:
    return GateReport(
        champion="old",
        champion_id="a" * 64,
        circuit="lindenring",
        car="gt3",
        world="racing",
        seed=1,
        alpha=0.05,
        beta=0.05,
        races=8,
        wall_s=1.0,
        versions={},
        candidates=candidates,
    )


def test_wandb_has_a_run_a_night(told: Bulletin, monkeypatch: pytest.MonkeyPatch) -> None:
    wandb = pytest.importorskip("wandb")
    from nathlon.lab.sinks.wandb_run import log_night

    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    place = Path(log_night(told, "team/racing"))
    wandb.teardown()  # the log is whole once its process has ended
    assert told.folder is not None
    assert place.is_relative_to(told.folder.parent)
    [log] = place.parent.glob("*.wandb")
    kept = log.read_bytes()
    assert told.headline.encode() in kept
    assert f"report-{told.key}".encode() in kept
    assert b"sent-harbour-gt3" in kept


def test_tensorboard_has_a_step_a_night(told: Bulletin, tmp_path: Path) -> None:
    pytest.importorskip("torch")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    from nathlon.lab.sinks.tensorboard_events import log_night

    log_night(told, str(tmp_path))
    events = EventAccumulator(str(tmp_path)).Reload()
    [point] = events.Scalars("nights/points_per_race")
    assert (point.step, point.value) == (7, pytest.approx(told.ranking[0].points_per_race))
    assert [image.step for image in events.Images("ranking")] == [7]


def test_a_sink_that_hangs_or_is_not_there_costs_no_other(
    told: Bulletin, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery, "DEADLINE_S", 1e-3)
    late = deliver(told, {"webhook": "http://127.0.0.1:9/x"})
    assert late == (Delivery("webhook", None, "no answer within 0.001 s"),)
    assert late[0].sentence == " Not delivered to webhook: no answer within 0.001 s."


WAITS_FOR_THE_OTHER = """
import json, pathlib, sys, time
sink, folder = sys.argv[1], pathlib.Path(sys.argv[2])
told, other = json.load(sys.stdin)
(folder / sink).touch()
while not (folder / other).exists():
    time.sleep(0.005)
print(json.dumps([sink, None]))
"""
"""A sink that delivers once another has been given the night."""


def test_a_sink_that_takes_its_time_keeps_no_other_waiting(
    told: Bulletin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def command(module: str, sink: str) -> list[str]:
        return [sys.executable, "-S", "-E", "-c", WAITS_FOR_THE_OTHER, sink, str(tmp_path)]

    monkeypatch.setattr(delivery, "command_of", command)
    monkeypatch.setattr(delivery, "DEADLINE_S", 20.0)
    assert deliver(told, {"webhook": "slack", "slack": "webhook"}) == (
        Delivery("webhook", "webhook", None),
        Delivery("slack", "slack", None),
    )


def test_without_room_for_another_process_a_sink_is_named(
    told: Bulletin, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(subprocess, "Popen", full)
    assert deliver(told, {"slack": "x"}) == (Delivery("slack", None, "Resource temporarily unavailable"),)


def test_a_night_says_what_its_sinks_did_and_comes_to_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "broken.safetensors").write_bytes(b"no checkpoint")
    config = tmp_path / "nathlon.toml"
    config.write_text(
        '[nightly]\nanchors = []\n[results]\nwandb = "racing"\nwebhook = "$HOOK"\nslack = "$NOT_SET"\n'
    )
    with raw_model(answer(204, "")) as (address, heard):
        monkeypatch.setenv("HOOK", f"{address}/{SECRET}")
        done = nathlon("nightly", "--json", "--workers", "1", cwd=tmp_path)
        again = nathlon("nightly", "--json", "--workers", "1", cwd=tmp_path)
    assert (done.returncode, again.returncode) == (3, 0)
    said = json.loads(done.stdout)
    assert said["delivered"] == [
        {"sink": "webhook", "place": "127.0.0.1", "error": None},
        {"sink": "slack", "place": None, "error": "the environment variable NOT_SET is not set"},
    ]
    failed = "Not delivered to slack: the environment variable NOT_SET is not set."
    assert said["reason"].endswith(failed)
    [body] = bodies(heard)
    assert body["code"] == 3
    assert body["reason"].startswith("All that is new was set aside")
    assert SECRET not in done.stdout + done.stderr + again.stdout


def test_where_results_go_is_no_part_of_what_decides_them(tmp_path: Path) -> None:
    config = tmp_path / "nathlon.toml"
    config.write_text("")
    plain = read_config(config)
    assert plain.results.sinks == {}
    config.write_text('[results]\ntensorboard = "events"\nslack = "$HOOK"\nlink = "https://nights.example"\n')
    settings = read_config(config)
    assert settings.digest == plain.digest
    assert settings.results.sinks == {"tensorboard": str(tmp_path / "events"), "slack": "$HOOK"}
