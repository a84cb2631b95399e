"""The fleet of `serve --vehicle`: what the orchestrator is told of another vehicle."""

from pathlib import Path

import pytest

from launcher.other_vehicles import of_carla, of_mavlink
from orchestrator.fleet import read_fleet
from service_kit.settings import BadSetting

PORTS = {"sim": 9104, "mavlink_vehicle": 9105, "carla_world": 9106}


def test_a_drone_whose_cameras_are_simulated_flies_what_has_a_scene(tmp_path: Path) -> None:
    (member,) = read_fleet(of_mavlink("udpin://127.0.0.1:14540", None).fleet_file(tmp_path, PORTS, {}))
    assert (member.name, member.kind, member.room) == ("mavlink_vehicle", "simulator", 1)
    assert member.address == "http://127.0.0.1:9105"


def test_a_drone_with_cameras_of_its_own_flies_where_it_stands_and_the_simulator_what_has_a_scene(
    tmp_path: Path,
) -> None:
    other = of_mavlink("serial:///dev/ttyACM0:57600", tmp_path / "cameras.toml")
    assert other.settings["CAMERAS"] == str(tmp_path / "cameras.toml")
    token = {"MAVLINK_VEHICLE_TOKEN_FILE": "/run/secrets/drone"}
    drone, simulator = read_fleet(other.fleet_file(tmp_path, PORTS, token))
    assert (drone.kind, drone.address) == ("vehicle", "http://127.0.0.1:9105/v1/vehicle")
    assert drone.token_file == "/run/secrets/drone"
    assert (simulator.kind, simulator.address) == ("simulator", "http://127.0.0.1:9104")


def test_a_drone_in_carla_flies_what_has_a_scene(tmp_path: Path) -> None:
    (member,) = read_fleet(of_carla("127.0.0.1:2000").fleet_file(tmp_path, PORTS, {}))
    assert (member.kind, member.address) == ("simulator", "http://127.0.0.1:9106")


def test_a_token_that_is_in_no_file_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BadSetting, match="MAVLINK_VEHICLE_TOKEN_FILE"):
        of_mavlink("udpin://127.0.0.1:14540", None).fleet_file(tmp_path, PORTS, {"MAVLINK_VEHICLE_TOKEN": "s3cret"})
