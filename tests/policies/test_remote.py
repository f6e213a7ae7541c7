"""Checkpoints that lie elsewhere: each is fetched once, and what is there is what is listed."""

from __future__ import annotations

import hashlib
import json
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from nathlon.api.candidates import find_candidates
from nathlon.policies.remote import is_remote, local, on_this_machine
from nathlon.policies.remote.mirror import INDEX
from nathlon.selection.config import read_config
from nathlon.selection.nightly.watching import watch
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED

fsspec = pytest.importorskip("fsspec")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Any, list[str]]]:
    """A place in memory with two checkpoints, and the names of what is fetched from it."""
    files = fsspec.filesystem("memory")
    files.pipe("/bucket/runs/a/step-1.safetensors", BUNDLED[0].read_bytes())
    files.pipe("/bucket/runs/b/step-2.safetensors", BUNDLED[1].read_bytes())
    files.pipe("/bucket/runs/b/replay.safetensors", b"no checkpoint")
    files.pipe("/bucket/runs/b/notes.txt", b"none either")
    took: list[str] = []
    get = type(files).get_file

    def noted(self: Any, path: str, *others: Any, **more: Any) -> Any:
        took.append(path.rpartition("/")[2])
        return get(self, path, *others, **more)

    monkeypatch.setattr(type(files), "get_file", noted)
    yield files, took
    files.rm("/bucket", recursive=True)


def fetched(address: str) -> Path:
    return Path(local(address))


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*") if path.name != INDEX)


def test_addresses_are_told_from_paths_and_names() -> None:
    for address in ("wandb:a/b/c:v1", "mlflow:m@champion", "hf:a/b", "s3://b/c", "memory://x", "file:///x"):
        assert is_remote(address)
    for other in ("runs/a", "plugin:x", "driver:pace=0.9", "C:/runs", "mppi:a.safetensors", "hf", "object:1"):
        assert not is_remote(other)


def test_what_has_not_changed_is_fetched_once(bucket: tuple[Any, list[str]]) -> None:
    files, took = bucket
    folder = fetched("memory://bucket/runs")
    assert names(folder) == ["a/step-1.safetensors", "b/step-2.safetensors"]
    assert (folder / "a" / "step-1.safetensors").read_bytes() == BUNDLED[0].read_bytes()
    assert fetched("memory://bucket/runs") == folder
    assert took == ["step-1.safetensors", "step-2.safetensors"]
    files.pipe("/bucket/runs/a/step-1.safetensors", BUNDLED[2].read_bytes())
    files.rm("/bucket/runs/b/step-2.safetensors")
    fetched("memory://bucket/runs")
    assert took[2:] == ["step-1.safetensors"]
    assert names(folder) == ["a/step-1.safetensors"]
    (folder / "a" / "step-1.safetensors").write_bytes(b"spoilt here")
    fetched("memory://bucket/runs")
    assert (folder / "a" / "step-1.safetensors").read_bytes() == BUNDLED[2].read_bytes()


def test_an_address_is_a_folder_to_commands_and_nights(bucket: tuple[Any, list[str]], tmp_path: Path) -> None:
    assert on_this_machine(["memory://bucket/runs", "runs/a"]) == ["runs/a"]
    found = find_candidates("memory://bucket/runs")
    assert [Path(source).name for source in found.sources] == ["step-1.safetensors", "step-2.safetensors"]
    assert found.named == set()
    (tmp_path / "nathlon.toml").write_text('checkpoints = ["memory://bucket/runs", "memory://bucket/none"]')
    config = read_config(tmp_path / "nathlon.toml")
    (bucket[0]).mkdir("/bucket/none")
    watched = watch(config.checkpoints)
    assert set(watched.digests.values()) == {
        hashlib.sha256(one.read_bytes()).hexdigest() for one in BUNDLED[:2]
    }
    assert len(watched.empty) == 1


def test_one_file_and_a_folder_of_this_machine_have_addresses(tmp_path: Path) -> None:
    (tmp_path / "one.safetensors").write_bytes(BUNDLED[0].read_bytes())
    assert names(fetched(f"file://{tmp_path}/one.safetensors")) == ["one.safetensors"]
    assert "one.safetensors" in names(fetched(f"file://{tmp_path}"))


@pytest.mark.parametrize("scheme", ["memory", "file"])
def test_one_file_that_changes_is_fetched_again(
    scheme: str, bucket: tuple[Any, list[str]], tmp_path: Path
) -> None:
    address = f"file://{tmp_path}/one.zip" if scheme == "file" else "memory://bucket/one.zip"
    files = fsspec.filesystem(scheme)
    for content in (b"once", b"then"):
        files.pipe(address.partition("://")[2], content)
        assert (fetched(address) / "one.zip").read_bytes() == content


def test_what_has_no_mark_is_fetched_every_time_and_never_more_than_a_checkpoint_may_have(
    bucket: tuple[Any, list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from nathlon.policies.remote import by_fsspec

    files, took = bucket

    def bare(self: Any, path: str, **more: Any) -> dict[str, Any]:
        return {"/bucket/runs/a/step-1.safetensors": {"size": None}}

    with monkeypatch.context() as patched:
        patched.setattr(type(files), "find", bare)
        for _ in range(2):
            assert names(fetched("memory://bucket/runs")) == ["a/step-1.safetensors"]
        assert took == ["step-1.safetensors"] * 2
        patched.setattr(by_fsspec, "MOST_BYTES", 1000)
        with pytest.raises(InputError, match="cannot be fetched: a file has more than 1000 bytes"):
            fetched("memory://bucket/runs")


def test_a_run_of_mlflow_that_goes_on_may_log_the_same_path_again(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mlflow")
    from nathlon.policies.remote import by_mlflow

    info = SimpleNamespace(end_time=None)
    client = SimpleNamespace(
        get_run=lambda run: SimpleNamespace(info=info),
        list_artifacts=lambda run, path: [SimpleNamespace(path="last.zip", is_dir=False, file_size=3)],
    )
    monkeypatch.setattr(by_mlflow, "MlflowClient", lambda: client)
    listing = by_mlflow.MlflowRemote("runs/abc").listing
    assert listing()["last.zip"].mark is None
    info.end_time = 17
    assert listing()["last.zip"].mark == "abc 17 3"


def test_an_address_is_said_without_what_signs_it(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    from nathlon.policies.remote import mirror

    def listing() -> None:
        raise OSError("404 for https://me:pa@ss-word@host/runs?signature=abcdef; pa@ss-word is wrong")

    monkeypatch.setattr(mirror, "_remote", lambda address: SimpleNamespace(listing=listing))
    with pytest.raises(InputError) as caught:
        fetched("https://me:pa@ss-word@host/runs?signature=abcdef")
    assert str(caught.value) == (
        "https://***@host/runs: cannot be fetched: 404 for https://***@host/runs?*** *** is wrong"
    )
    monkeypatch.setattr(mirror, "_remote", lambda address: SimpleNamespace(listing=dict))
    assert "abcdef" not in fetched("https://host/runs?signature=abcdef").name


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("nosuch://me:secret@host/x", r"^nosuch://\*\*\*@host/x: cannot be fetched: Protocol not known"),
        ("memory://bucket/nowhere", "^memory://bucket/nowhere: cannot be fetched: there is nothing"),
    ],
)
def test_a_place_that_cannot_be_reached_is_one_sentence(address: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        fetched(address)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("address", "module", "extra"),
    [
        ("s3://bucket/runs", "fsspec", "remote"),
        ("hf:team/racer", "huggingface_hub", "hf"),
        ("mlflow:racer@champion", "mlflow", "mlflow"),
        ("wandb:team/racing/policies:latest", "wandb", "wandb"),
    ],
)
def test_what_an_address_needs_is_named(
    address: str, module: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=f": needs {module}, which the extra {extra} installs"):
        fetched(address)


def test_a_listing_leads_nowhere_else(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    from nathlon.policies.remote import mirror
    from nathlon.policies.remote.remote import Listed

    outside = (
        "../out.zip",
        "/out.zip",
        "a/../../out.zip",
        "a//out.zip",
        "C:out.zip",
        "a\\out.zip",
        "a\0.zip",
    )
    listing = {path: Listed("1", 1) for path in (*outside, "in.zip")}
    remote = SimpleNamespace(listing=lambda: listing, fetch=lambda path, to: to.write_bytes(b"1"))
    monkeypatch.setattr(mirror, "_remote", lambda address: remote)
    assert names(fetched("s3://evil")) == ["in.zip"]
    assert [path.name for path in cache.rglob("*.zip")] == ["in.zip"]
    both = SimpleNamespace(
        listing=lambda: {"a.zip": Listed("1", 1), "a.zip/b.zip": Listed("1", 1)}, fetch=remote.fetch
    )
    monkeypatch.setattr(mirror, "_remote", lambda address: both)
    with pytest.raises(InputError, match="s3://both: cannot be fetched: "):
        fetched("s3://both")
    large = SimpleNamespace(listing=lambda: {"big.zip": Listed("1", 1 << 40)})
    monkeypatch.setattr(mirror, "_remote", lambda address: large)
    with pytest.raises(InputError, match=r"big\.zip has 1099511627776 bytes, expected at most"):
        fetched("s3://large")


def test_an_artefact_of_wandb_is_fetched_by_its_digests(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Their servers cannot be had here: what their interface gives is played."""
    wandb = pytest.importorskip("wandb")

    class Entry:
        digest, size = "md5", 3

        def download(self, root: str) -> str:
            took.append(root)
            (Path(root) / "step.zip").write_bytes(b"zip")
            return f"{root}/step.zip"

    took: list[str] = []
    entry = Entry()
    artefact = SimpleNamespace(
        manifest=SimpleNamespace(entries={"runs/step.zip": entry}), get_entry=lambda path: entry
    )
    asked: list[str] = []

    def artifact(name: str) -> SimpleNamespace:
        asked.append(name)
        return artefact

    api = SimpleNamespace(artifact=artifact)
    monkeypatch.setattr(wandb, "Api", lambda: api)
    folder = fetched("wandb:team/racing/policies:latest")
    assert names(folder) == ["runs/step.zip"]
    fetched("wandb:team/racing/policies:latest")
    assert len(took) == 1
    assert asked == ["team/racing/policies:latest"] * 2


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """A server that answers as the hub of Hugging Face does; the paths that it is asked for."""
    content, heard = BUNDLED[0].read_bytes(), []
    oid = hashlib.sha256(content).hexdigest()
    file = {"type": "file", "oid": "1" * 40, "size": len(content), "path": "runs/step.safetensors"}
    file |= {"lfs": {"oid": oid, "size": len(content), "pointerSize": 130}}
    tree = [{"type": "directory", "oid": "2" * 40, "size": 0, "path": "runs"}, file]

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            heard.append(f"{self.command} {self.path.partition('?')[0]}")
            body, kind = b"", "application/json"
            if "/tree/" in self.path:
                body = json.dumps(tree).encode()
            elif self.path.startswith("/api/models/"):
                body = json.dumps({"id": "team/racer", "sha": "3" * 40, "siblings": []}).encode()
            elif "/resolve/" in self.path:
                body, kind = content, "application/octet-stream"
            self.send_response(200 if body else 404)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("ETag", f'"{oid}"')
            self.send_header("X-Repo-Commit", "3" * 40)
            self.end_headers()
            if self.command == "GET":
                self.wfile.write(body)

        do_HEAD = do_GET

        def log_message(self, format: str, *args: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    url = f"http://127.0.0.1:{server.server_port}"
    hub = pytest.importorskip("huggingface_hub")
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "ENDPOINT", url)
    template = url + "/{repo_id}/resolve/{revision}/{filename}"
    monkeypatch.setattr(constants, "HUGGINGFACE_CO_URL_TEMPLATE", template)
    hub.HfFileSystem.clear_instance_cache()
    yield heard
    server.shutdown()
    hub.HfFileSystem.clear_instance_cache()


def test_a_repository_of_hugging_face_is_fetched_once(hub: list[str]) -> None:
    folder = fetched("hf:team/racer/runs")
    assert names(folder) == ["step.safetensors"]
    assert (folder / "step.safetensors").read_bytes() == BUNDLED[0].read_bytes()
    fetched("hf:team/racer/runs")
    assert sum(asked.startswith("GET /team/racer/resolve/") for asked in hub) == 1
