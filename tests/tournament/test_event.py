"""Events: what their files may say."""

from pathlib import Path

import pytest

from nathlon.sim.errors import InputError
from nathlon.tournament.event import load_event
from nathlon.tournament.formats import FORMATS

THREE = """
[[race]]
name = "seaside"
circuit = "porto-sereno"
car = "coupe"

[[race]]
name = "grand prix"
circuit = "lindenring"
car = "gt3"
format = "10v10"

[[race]]
name = "long"
circuit = "grandes-landes"
car = "prototype"
scenario = "race:laps=4"
weight = 2.0
pairs = 4
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "event.toml"
    path.write_text(text, "utf-8")
    return path


def test_an_event_of_three_circuits(tmp_path: Path) -> None:
    event = load_event(written(tmp_path, THREE))
    assert event.weights == {"seaside": 1.0, "grand prix": 1.0, "long": 2.0}
    assert [race.raced for race in event.race] == ["race", "grand_prix", "race:laps=4"]
    assert [race.pairs for race in event.race] == [None, None, 4]
    assert [FORMATS[race.format].cars for race in event.race] == [8, 20, 8]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (("weight = 2.0", "weight = 0.0"), "race.2.weight"),
        (('format = "10v10"', 'format = "5v5"'), "race.1.format"),
        (('name = "long"', 'name = "seaside"'), "two races are called 'seaside'"),
        (("pairs = 4", "pairs = 4\nhearts = 3"), "race.2.hearts"),
        (('"race:laps=4"', '"race:laps=none"'), "laps is 'none', expected a number from 1 to 1000"),
        (('"race:laps=4"', '"race_1v1"'), "race 'long': scenario 'race_1v1' has 2 cars, expected 8"),
        (('"lindenring"', '"nordschleife"'), "nordschleife"),
    ],
)
def test_a_wrong_file_is_named_with_its_fault(
    tmp_path: Path, change: tuple[str, str], complaint: str
) -> None:
    path = written(tmp_path, THREE.replace(*change))
    with pytest.raises(InputError) as caught:
        load_event(path)
    assert complaint in str(caught.value)


def test_an_event_without_a_race_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="race"):
        load_event(written(tmp_path, "race = []"))
    with pytest.raises(InputError, match="cannot read the event file"):
        load_event(tmp_path / "nowhere.toml")
