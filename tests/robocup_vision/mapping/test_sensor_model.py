"""Sensor models: what they add to a cell, their file, and how they are learnt."""

import numpy as np
import pytest
from wrong_files import problem_of

from field_models.errors import ArgumentError, FileError
from robocup_vision.kernels.mapping.occupancy import CROSSED, HIT
from robocup_vision.mapping.sensor_model import SensorModel, SensorTally, default_sensors, load_sensors, write_sensors

GOOD = """format = 1
source = "by hand"

[sensors.sonar]
hit_if_occupied = 0.8
hit_if_free = 0.1
nearest_m = 0.2
reach_m = 1.5
"""


def test_files_are_read_as_they_were_written(tmp_path):
    models = {"sonar": SensorModel(0.8, 0.1, 0.2, 1.5), "camera_2": SensorModel(0.75, 0.0625)}
    path = tmp_path / "sensors.toml"
    write_sensors(path, models, "a 'quoted' command with \"both\" and a\ttab")
    assert load_sensors(path) == models


def test_the_projects_own_file_is_sound():
    models = default_sensors()
    assert list(models) == ["floor", "range"]
    assert all(model.hit_step > 0 > model.crossed_step for model in models.values())
    models.clear()
    assert default_sensors()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "format = 2", "key 'format'"),
        ("hit_if_free = 0.1\n", "", "key 'sensors.sonar.hit_if_free': is missing"),
        ("reach_m = 1.5", "reach_m = 1.5\nrange = 3", "key 'sensors.sonar.range': is unknown, got 3"),
        ("hit_if_occupied = 0.8", "hit_if_occupied = 'often'", "key 'sensors.sonar.hit_if_occupied': expected `float`"),
        ("hit_if_occupied = 0.8", "hit_if_occupied = 1.0", "key 'sensors.sonar': probabilities must be 0 <"),
        ("hit_if_free = 0.1", "hit_if_free = 0.9", "hit_if_free 0.9, hit_if_occupied 0.8"),
        ("reach_m = 1.5", "reach_m = 0.1", "ranges must be 0 <= nearest_m < reach_m, got nearest_m 0.2, reach_m 0.1"),
        (GOOD[GOOD.index("[") :], "[sensors]\nsonar = 3\n", "key 'sensors.sonar': expected `object`, got `int`"),
        (GOOD[GOOD.index("[") :], "[sensors]\n", "key 'sensors': must name at least one sensor"),
    ],
)
def test_impossible_files_are_refused_by_name_and_key(tmp_path, old, new, message):
    path = tmp_path / "sensors.toml"
    path.write_text(GOOD)
    assert load_sensors(path)["sonar"].reach_m == 1.5
    assert message in problem_of(load_sensors, path, GOOD, old, new)


def test_files_that_cannot_be_written_are_reported(tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        write_sensors(tmp_path / "absent" / "sensors.toml", {"sonar": SensorModel(0.8, 0.1)}, "")
    with pytest.raises(ArgumentError, match="must be of letters, digits, _ and -, got 'a b'"):
        write_sensors(tmp_path / "sensors.toml", {"a b": SensorModel(0.8, 0.1)}, "")


def test_a_tally_counts_ratios_of_cells_with_evidence():
    evidence = np.array([[HIT, HIT, HIT, CROSSED], [HIT, CROSSED, CROSSED, CROSSED], [0, 0, HIT, CROSSED]], np.int8)
    occupied = np.array([[1, 1, 1, 1], [0, 0, 0, 0], [1, 0, 0, 0]], dtype=bool)
    free = np.array([[0, 0, 0, 0], [1, 1, 1, 1], [0, 1, 0, 0]], dtype=bool)
    tally = SensorTally()
    tally.add(evidence, occupied, free)
    np.testing.assert_array_equal(tally.counts, [[3, 1], [1, 3]])
    tally.add(evidence, occupied, free)
    model = tally.model(0.1, 2.0)
    assert model == SensorModel(7 / 10, 3 / 10, 0.1, 2.0)


def test_a_sensor_without_information_is_refused():
    with pytest.raises(ArgumentError, match="the sensor gives no information: it has hits in 50"):
        SensorTally().model(0.0, 1.0)
