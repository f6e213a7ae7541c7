"""A race with a person in it: run again it is the same to the bit, and it is kept as any other."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from nathlon.api.race import race
from nathlon.api.twin import twin
from nathlon.arena.match_policies import match_policies
from nathlon.arena.recorder import record_races
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.store import Store
from nathlon.lab.drive.aids import Controls
from nathlon.lab.drive.choice import Choice, DriveOpponent, Offer, plan
from nathlon.lab.drive.clock import FURTHEST_BEHIND_S
from nathlon.lab.drive.frames import CAR, COUNTDOWN, DRIVING, FINISHED, HEAD, OUT, OVER, RACING, car_rows
from nathlon.lab.drive.heat import DrivenHeat
from nathlon.lab.drive.input_buffer import INPUT, InputBuffer
from nathlon.lab.drive.keeping import Kept, keep
from nathlon.policies.sources.finding import find_sources
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.recordings import stored_match
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.errors import InputError
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import load_track
from tests.support.drives import MARKED, STOP, Hurry, choice, drive, inputs, offer, opening, planned


@pytest.fixture(scope="module")
def driven() -> tuple[DrivenHeat, list[bytes]]:
    return drive(planned())


@pytest.fixture(scope="module")
def kept(driven: tuple[DrivenHeat, list[bytes]], tmp_path_factory: pytest.TempPathFactory) -> Kept:
    return keep(driven[0], OutputFolder(tmp_path_factory.mktemp("drive")))


def test_the_person_acts_in_every_step_and_the_others_at_their_rate(
    driven: tuple[DrivenHeat, list[bytes]],
) -> None:
    done = driven[0]
    row = done.results.filter(done.results["car"] == 1).row(0, named=True)
    assert row["ending"] == "stuck"
    assert len(done.controls) == pytest.approx(60.0 * row["driven_s"], abs=1.5)
    changes = (np.diff(done.controls, axis=0) != 0.0).any(axis=1).nonzero()[0] + 1
    assert {int(step) % 6 for step in changes} == set(range(6))


def test_a_race_run_again_from_its_inputs_is_the_same_to_the_bit(kept: Kept, tmp_path: Path) -> None:
    root = kept.recording.parent.parent
    with Store.open(root / "store.sqlite") as store:
        [run] = store.runs()
        entrants = store.table(run.name, "entrants")
        match = stored_match(store, read_recording(kept.recording).match, entrants)
        stored = store.results_of([match.key])
    names = dict(entrants.select("entrant", "name").iter_rows())
    again = record_races(match, match_policies(match), [0], [names[one] for one in match.entrants])
    assert again.results.equals(stored)
    write_recording(tmp_path / "again.mcap", again.logs[0])
    assert (tmp_path / "again.mcap").read_bytes() == kept.recording.read_bytes()


def test_a_marked_moment_is_kept_with_the_drive(driven: tuple[DrivenHeat, list[bytes]], kept: Kept) -> None:
    done, frames = driven
    [mark] = done.marks
    heads = np.array([np.frombuffer(frame, HEAD, 1)[0] for frame in frames])
    assert mark.time_s == pytest.approx(heads["time_s"][MARKED - 1], abs=1.5 * DYNAMICS_DT)
    cars = np.frombuffer(frames[MARKED - 1], CAR, 3, HEAD.itemsize)
    apart = [float(np.hypot(cars["x"][i] - cars["x"][1], cars["y"][i] - cars["y"][1])) for i in (0, 2)]
    assert mark.nearest == (0, 2)[int(np.argmin(apart))]
    assert mark.apart_m == pytest.approx(min(apart), abs=1.0)
    assert mark.lap_m == pytest.approx(cars["progress"][1] % load_track("lindenring").length, abs=2.0)
    with Store.open(kept.recording.parent.parent / "store.sqlite") as store:
        [run] = store.runs()
        told = store.facts(run.name)["marks"]
    assert told == [mark._asdict() | {"nearest": done.plan.grid[mark.nearest]}]


def test_a_race_with_other_inputs_is_another_one(driven: tuple[DrivenHeat, list[bytes]]) -> None:
    made, frames = driven[0].plan, driven[1]
    other = opening(made, seed=2)
    own = [np.frombuffer(each[STOP - 1], CAR, 3, HEAD.itemsize)["x"][1] for each in (frames, other)]
    assert abs(own[0] - own[1]) > 1.0


def test_a_recording_of_a_drive_has_a_twin(kept: Kept, tmp_path: Path) -> None:
    """It is run again by the race runner's own processes, once with a driver in the person's place."""
    result = twin(kept.recording, car=2, policy="driver:pace=0.95", at_s=2.0, out=tmp_path, progress=False)
    assert result.parted_s == pytest.approx(2.0, abs=0.2)
    assert result.outcomes["driver"].to_list() == ["human:Ada", "driver:pace=0.95 from 2 s"]


def test_a_person_races_again_by_name_but_is_never_selected_among(kept: Kept) -> None:
    source = f"human:{kept.inputs}"
    result = race([source, "driver:pace=0.9"], scenario="drive:laps=1,cars=2,person=1", circuit="lindenring")
    assert set(result.results["name"]) == {"human:Ada", "driver:pace=0.9"}
    with pytest.raises(InputError, match="is a person, expected a policy"):
        find_sources([source])


def test_frames_tell_of_the_countdown_the_race_and_its_end(driven: tuple[DrivenHeat, list[bytes]]) -> None:
    _, frames = driven
    heads = np.array([np.frombuffer(frame, HEAD, 1)[0] for frame in frames])
    phases = heads["phase"]
    assert list(dict.fromkeys(phases.tolist())) == [COUNTDOWN, RACING, OVER]
    racing = heads[phases == RACING]
    assert np.array_equal(racing["tick"], np.arange(len(racing)))
    cars = np.frombuffer(frames[-1], CAR, 3, HEAD.itemsize)
    assert sorted(cars["place"].tolist()) == [1, 2, 3]
    assert all(len(frame) == HEAD.itemsize + 3 * CAR.itemsize for frame in frames)


def test_a_car_behind_the_flag_has_finished_and_is_not_out() -> None:
    cars = np.zeros(3, CAR_STATE)
    cars["finish_s"], cars["driving"] = (50.0, np.nan, np.nan), (False, True, False)
    assert car_rows(cars)["doing"].tolist() == [FINISHED, DRIVING, OUT]


def test_the_grid_is_filled_in_turn_around_the_person() -> None:
    made = planned(cars=6, seat=3)
    assert made.grid == (
        "driver:pace=0.9",
        "driver:pace=0.8",
        "human:Ada",
        "driver:pace=0.9",
        "driver:pace=0.8",
        "driver:pace=0.9",
    )
    assert Counter(planned(cars=1, seat=1, opponents=()).grid) == {"human:Ada": 1}


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"circuit": "nowhere"}, "the choice: circuit 'nowhere' is unknown, expected one of lindenring"),
        ({"car": "bus"}, "the choice: car 'bus' is unknown, expected one of gt3"),
        ({"opponents": (0, 99)}, r"opponents are \[0, 99\], expected numbers from 0 to"),
    ],
)
def test_what_is_not_offered_is_refused(other: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        plan(choice(**other), offer())


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"seat": 4}, "seat is 4, expected a place from 1 to 3"),
        ({"opponents": ()}, "3 cars and no opponent"),
        ({"laps": 0}, "field laps is 0"),
        ({"name": "a\nb"}, "field name"),
        ({"laps": "1"}, "field laps is '1'"),
        ({"more": 1}, "field more is unknown"),
    ],
)
def test_a_choice_that_cannot_be_is_refused(other: dict[str, object], said: str) -> None:
    facts = choice().model_dump(mode="json") | {
        name: list(value) if isinstance(value, tuple) else value for name, value in other.items()
    }
    with pytest.raises(InputError, match=f"the choice: .*{said}"):
        Choice.read(facts)


def test_only_who_can_drive_there_is_offered_there() -> None:
    made = DriveOpponent("a.safetensors", "a", "lindenring", "gt3")
    assert made.drives("lindenring", "gt3")
    assert not made.drives("lindenring", "coupe")
    offered = Offer.of([made._replace(circuit="porto-sereno")])
    assert offered.circuits[0] == "porto-sereno"
    with pytest.raises(InputError, match="circuit 'nowhere' is unknown"):
        Offer.of([], circuit="nowhere")


def test_late_inputs_never_take_the_place_of_later_ones() -> None:
    buffer = InputBuffer()
    buffer.put(inputs(2, steering=0.5, throttle=3.0))
    buffer.put(inputs(1, steering=-0.5))
    assert buffer.latest.controls == Controls(False, 0.5, 1.0, 0.0)
    for frame in (b"", inputs(3) + b"x", INPUT.pack(3, False, float("nan"), 0.0, 0.0)):
        with pytest.raises(ValueError, match="a frame of inputs"):
            buffer.put(frame)
    assert buffer.latest.number == 2


def test_steps_are_due_by_absolute_deadlines() -> None:
    hurry = Hurry()
    clock = hurry.clock()
    clock.start()
    for _ in range(60):
        clock.wait()
        hurry.now_s += 0.5 * DYNAMICS_DT  # the step itself
    assert hurry.now_s == pytest.approx(100.0 + 59.5 * DYNAMICS_DT)
    assert max(clock.late_s) == pytest.approx(0.0, abs=1e-9)


def test_a_world_that_is_far_behind_loses_the_time_and_one_that_is_not_makes_up_for_it() -> None:
    hurry = Hurry()
    clock = hurry.clock()
    clock.start()
    clock.wait()
    hurry.now_s += 2.0 * DYNAMICS_DT
    clock.wait()
    clock.wait()
    assert clock.late_s[1:] == pytest.approx([DYNAMICS_DT, 0.0], abs=1e-9)
    hurry.now_s += 5.0 * FURTHEST_BEHIND_S
    clock.wait()
    clock.wait()
    assert clock.late_s[-2] > FURTHEST_BEHIND_S
    assert clock.late_s[-1] == pytest.approx(0.0, abs=1e-9)


def test_drives_of_one_person_lie_beside_each_other(
    driven: tuple[DrivenHeat, list[bytes]], kept: Kept
) -> None:
    output = OutputFolder(kept.recording.parent.parent)
    done = driven[0]
    controls = done.controls.copy()
    controls[0] = 0.5
    other = keep(done._replace(controls=controls), output)
    assert other.inputs != kept.inputs
    assert other.inputs.parent == kept.inputs.parent
    with Store.open(output.store) as store:
        assert len(store.runs()) == 2
        assert not any(len(store.table(run.name, "ranking")) for run in store.runs())
        assert store.verify() == []
