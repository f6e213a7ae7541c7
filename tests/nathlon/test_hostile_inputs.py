"""Files that users write, when they are spoilt, absurd or no files: one sentence, or something that ends."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from nathlon.api.selection import configured
from nathlon.arena.recording import read_recording, recover_recording
from nathlon.arena.store import Store
from nathlon.policies.load import load_policy
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.training.config import CONFIGS
from nathlon.policies.training.config import read_config as read_training
from nathlon.policies.training.run_folder import CONFIG_FILE
from nathlon.policies.training.trainer import Trainer
from nathlon.selection.battery.skill import SKILLS_FOLDER, read_skill
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.config import TEMPLATE, read_config
from nathlon.sim.car import Car, read_car
from nathlon.sim.data_file import DATA, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.rules import Rules, rule_parameters
from nathlon.sim.scenario import Scenario, load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.untrusted_file import open_regular
from nathlon.tournament.event import load_event
from tests.support.command_line import nathlon, refused
from tests.support.committees import PEOPLE, RUN, ask
from tests.support.spoiling import NO_FILES, no_file, spoilt_toml

MUTATIONS = 150
MEMORY_MIB = 2048
TRACK = load_track("porto-sereno")
CAR = (DATA / "cars" / "gt3.toml").read_text()
RACE = (DATA / "scenarios" / "race.toml").read_text()
SPORTING = (DATA / "rules" / "sporting.toml").read_text()
NIGHT = TEMPLATE.read_text()
TRAINING = (CONFIGS / "racing.toml").read_text()
COMPOSITE = """
name = "mixed"
[[part]]
policy = "driver:pace=0.9"
until_m = 500.0
sections = ["longest straight"]
circuit = "porto-sereno"
[[part]]
policy = "driver"
"""
EVENT = """
[[race]]
name = "short"
circuit = "lindenring"
car = "gt3"
format = "1v1"
scenario = "race_1v1"
weight = 2.0
pairs = 4
"""


@pytest.fixture(autouse=True)
def little_memory() -> Iterator[None]:
    """No input may take more memory than is promised."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MEMORY_MIB << 10


def drive(scenario: Scenario, car: Car) -> None:
    """Race for five seconds, with anything that a policy might do; no number may make the simulator stray."""
    rng = np.random.default_rng(1)
    world = scenario.world(TRACK, car, 1)
    world.reset(0, scenario.place(TRACK, rng))
    races, cars = np.zeros(scenario.cars, np.int64), np.arange(scenario.cars)
    for _ in range(50):
        world.step(rng.uniform(-1.0, 1.0, (1, scenario.cars, 2)))
        world.observe(ObservationSpec(), races, cars)
    assert ((world.state["row"] >= 0) & (world.state["row"] < len(TRACK.table))).all()


def read_and_drive(path: Path) -> None:
    """Read a scenario and drive it; with laps or without."""
    load_scenario.cache_clear()
    scenario = load_scenario(str(path))
    drive(scenario, read_car(DATA / "cars" / "gt3.toml"))


def read_rules(path: Path) -> None:
    """Read rules as the kernels do."""
    *numbers, pit = rule_parameters(read_toml(path, Rules, "rules"))
    assert np.isfinite([*numbers, *pit]).all()


def drive_composite(path: Path) -> None:
    """Drive on the line of a composite."""
    policy = load_policy(str(path), "porto-sereno", "gt3")
    seen = np.zeros((3, policy.observation_spec.size), np.float32)
    policy.act(seen, policy.initial_memory(3))


def resume(path: Path) -> None:
    """Go on with a run of training whose description is at the path."""
    path.rename(path.parent / CONFIG_FILE)
    Trainer.resume(path.parent)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "car": (
        CAR,
        lambda path: drive(read_toml(DATA / "scenarios" / "race.toml", Scenario, ""), read_car(path)),
    ),
    "scenario": (RACE, read_and_drive),
    "rolling": ((DATA / "scenarios" / "emergency_avoidance.toml").read_text(), read_and_drive),
    "rules": (SPORTING, read_rules),
    "configuration": (NIGHT, lambda path: read_config(path)),
    "training": (TRAINING, read_training),
    "composite": (COMPOSITE, drive_composite),
    "event": (EVENT, load_event),
    "skill": ((SKILLS_FOLDER / "start_back.toml").read_text(), read_skill),
}


@pytest.mark.parametrize("kind", READERS)
def test_spoilt_files_are_one_sentence_or_mean_something(tmp_path: Path, kind: str) -> None:
    text, read = READERS[kind]
    rng, outcomes = np.random.default_rng(len(kind)), []
    for number in range(MUTATIONS):
        path = tmp_path / f"{kind}-{number}.toml"
        path.write_bytes(spoilt_toml(text, rng))
        try:
            read(path)
            outcomes.append("read")
        except InputError as error:
            said = str(error)
            assert said.isprintable(), said
            assert len(said) < 2100
            outcomes.append("refused")
    assert set(outcomes) == {"read", "refused"}


@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize(
    "read",
    [
        read_car,
        read_and_drive,
        read_rules,
        read_config,
        read_training,
        CompositeSource.read,
        load_event,
        read_skill,
        read_recording,
        recover_recording,
        lambda path: Trainer.resume(path.parent),
        configured,
        open_regular,
    ],
)
def test_what_is_no_file_is_refused_at_once(
    tmp_path: Path, kind: str, read: Callable[[Path], object]
) -> None:
    path = no_file(tmp_path, kind, ".toml")
    if read is open_regular and kind in ("huge", "binary"):
        open_regular(path).close()
        return
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(str(tmp_path))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a." * 30_000 + "a = 1", "keys of at most 16 parts"),
        ('"a b" . ' * 30_000 + "a = 1", "keys of at most 16 parts"),
        ("a = " + "[" * 100_000, "not nested so deep"),
        ("a = " + "9" * 5000, "4300 digits"),
        ("x" * 2_000_000, "larger than 1 MiB"),
        ('"\\u001b[2J\\n" = 1\n' + CAR, r"field \\x1b\[2J\\n is unknown"),
        (f'name = ["{"x" * 900_000}"]', r"field name is \['xxx.* \.\.\. .*valid string"),
    ],
)
def test_files_that_would_take_all_time_memory_or_the_terminal(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "car.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read_car(path)
    assert str(caught.value).isprintable()


def test_a_byte_order_mark_and_other_line_ends_change_nothing(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_bytes(b"\xef\xbb\xbf" + CAR.replace("\n", "\r\n").encode())
    assert read_car(path) == read_car(DATA / "cars" / "gt3.toml")


@pytest.mark.parametrize(
    ("kind", "old", "new", "field"),
    [
        ("car", "mass_kg = 1370.0", "mass_kg = 1e-300", "body.mass_kg"),
        ("car", "capacity_kg = 80.0", "capacity_kg = 1370.0", "fuel.capacity_kg must be less"),
        ("car", "friction_lateral = [1.62, 1.41]", "friction_lateral = [0.0, 0.0]", "friction_lateral"),
        (
            "car",
            "friction_lateral = [1.62, 1.41]",
            "friction_lateral = [1.62, 0.1]",
            "friction_lateral falls",
        ),
        ("scenario", "time_s = 600.0", "time_s = 1e9", "time_s"),
        ("scenario", "laps = 2", "laps = 1000000", "laps"),
        ("scenario", "cars = 8", "cars = 1000000000", "cars"),
        ("scenario", "laps = 2", "finish_m = 1e308", "finish_m"),
        ("rolling", "speed_m_s = [38.0, 48.0]", "speed_m_s = [38.0, 1e300]", "speed_m_s"),
        ("rules", "rear_end_s = 3.0", "rear_end_s = 1e308", "contact.rear_end_s"),
        ("rules", "warnings = 3", f"warnings = {2**63}", "limits.warnings"),
        ("configuration", "pairs = 12", "pairs = 1000000000", "tournament.pairs"),
        ("configuration", "seed = 1", f"seed = {2**63}", "seed"),
        ("configuration", "# workers = 2", "workers = 1000000000", "workers"),
        ("configuration", "shortlist = 6", "shortlist = 1000000000", "committee.shortlist"),
        ("training", "races = ", "races = 1000000000 #", "rollouts.0.races"),
        ("training", "updates = ", f"updates = {10**400} #", "updates"),
        ("event", "pairs = 4", "pairs = 1000000000", "race.0.pairs"),
        ("skill", "exponent = ", "exponent = 1e308 #", "scoring.exponent"),
    ],
)
def test_what_no_machine_can_run_is_refused_by_its_field(
    tmp_path: Path, kind: str, old: str, new: str, field: str
) -> None:
    text, read = READERS[kind]
    assert old in text
    path = tmp_path / "absurd.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert field in str(caught.value)


@pytest.mark.parametrize("laps", ["1001", "9" * 5000, "0", "-1", "²"])
def test_laps_beyond_any_race(laps: str) -> None:
    with pytest.raises(InputError, match="expected a number from 1 to 1000"):
        load_scenario(f"race:laps={laps}")
    with pytest.raises(InputError, match="expected at most 86400 s"):
        load_scenario("race:laps=1000")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("torque_n_m = [ 330.0,  430.0,  520.0,  565.0,  590.0,  583.0,  560.0,  515.0,  440.0]", "{} * 9"),
        ("friction_lateral = [1.62, 1.41]", "friction_lateral = [0.01, 0.01]"),
    ],
)
def test_a_car_that_cannot_be_driven_is_one_sentence(tmp_path: Path, old: str, new: str) -> None:
    new = new if "{}" not in new else f"torque_n_m = {[0.0] * 9}"
    assert old in CAR
    (tmp_path / "car.toml").write_text(CAR.replace(old, new))
    done = nathlon("race", "driver", "--scenario", "time_trial", "--car", "car.toml", cwd=tmp_path)
    refused(done, "the built-in driver cannot drive 'lindenring'")
    assert [entry.name for entry in tmp_path.iterdir()] == ["car.toml"]


@pytest.mark.parametrize("speed", [1e6, 1e18, 1e300, np.inf, np.nan])
def test_what_a_car_at_any_speed_sees_is_found(speed: float) -> None:
    scenario = load_scenario("race")
    world = scenario.world(TRACK, read_car(DATA / "cars" / "gt3.toml"), 1)
    world.reset(0, scenario.place(TRACK, np.random.default_rng(1)))
    world.state["velocity_x"][0, 0] = speed
    seen = world.observe(ObservationSpec(), np.zeros(8, np.int64), np.arange(8))
    assert np.isfinite(seen[1:]).all()


@pytest.mark.parametrize(
    "arguments",
    [
        ("nightly", "--config"),
        ("status", "--config"),
        ("polish", "none.safetensors", "--config"),
        ("race", "driver", "--scenario"),
        ("race", "driver", "--car"),
        ("race",),
    ],
)
def test_commands_refuse_spoilt_files(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    path = tmp_path / "spoilt.toml"
    for data in (b"\xff", b"a = [", b"name = 1\n", b"\0", b'"\x1b[2J" = 1'):
        path.write_bytes(data)
        refused(nathlon(*arguments, path, cwd=tmp_path), "spoilt.toml")
        assert [entry.name for entry in tmp_path.iterdir()] == ["spoilt.toml"]


@pytest.mark.parametrize(
    "name", [",", "a,a", "\x1b[2J", "\0", "x" * 1_000_000, "\udcff", "../..", "nan", "\n", "rule:x"]
)
def test_the_committee_takes_any_words(tmp_path: Path, name: str) -> None:
    store = tmp_path / "store.sqlite"
    with Store(store) as opened:
        opened.begin_run(RUN, {})
        ask(EventLog(opened, RUN), PEOPLE)
    cast = ("committee", store, "vote", "--rank", "amber")
    refused(nathlon(*cast, "--member", name, "--reason", "calm", cwd=tmp_path), "is not on the committee")
    unknown = nathlon(
        *("committee", store, "compare", "--member", "ann", "--reason", "calm"),
        *("--better", name, "--worse", "amber"),
        cwd=tmp_path,
    )
    refused(unknown, "is not a candidate")
    refused(nathlon("committee", "--run", name, store, "show", cwd=tmp_path), "no run")
    spoken = nathlon(*cast, "--member", "ann", "--reason", f"calm {name}", cwd=tmp_path)
    if name.isprintable():
        assert spoken.returncode == 0
        assert nathlon("committee", store, "log", cwd=tmp_path).returncode == 0
    else:
        refused(spoken, "reason holds characters that cannot be printed")
