"""Which search the command line's options make."""

import pytest

from command_line.mission_options import ChoicePolicy, mission_settings
from contracts.orchestrator import MissionSettings
from mission.policies import BadSearch, completed


def settings(viewpoint: str | None = None, choice: ChoicePolicy | None = None) -> MissionSettings:
    return mission_settings(
        viewpoint=viewpoint,
        choice=choice,
        floors="stepwise",
        sightings="look-again",
        drift=0.0,
        parser=None,
        max_steps=30,
        rig="paper-five",
        image_size=None,
        seed=0,
    )


def test_without_options_the_settings_are_those_of_a_mission_over_rest() -> None:
    assert settings() == completed(MissionSettings())
    assert settings().viewpoint.policy == "contour"


@pytest.mark.parametrize(
    ("viewpoint", "choice"),
    [("paper", "centre"), ("paper", "model"), ("random", "centre"), ("default", None)],
)
def test_a_choice_goes_with_a_policy_that_has_points(viewpoint: str, choice: ChoicePolicy | None) -> None:
    made = settings(viewpoint, choice)
    assert made.viewpoint.policy == viewpoint
    assert made.viewpoint.constants["choice"] == (choice or "model")


@pytest.mark.parametrize("viewpoint", ["contour", None])
def test_the_explorer_offers_nothing_to_choose_from(viewpoint: str | None) -> None:
    with pytest.raises(BadSearch, match="the search policy contour has no setting choice"):
        settings(viewpoint, "centre")


def test_a_policy_that_there_is_not_is_told_with_those_that_there_are() -> None:
    with pytest.raises(BadSearch, match="no search policy sideways; there are paper, random, default, contour"):
        settings("sideways")


@pytest.mark.parametrize("given", [0, 1, None])
def test_how_a_first_floor_counts_is_a_setting_of_the_mission(given: int | None) -> None:
    made = mission_settings(
        viewpoint=None,
        choice=None,
        floors="stepwise",
        sightings="look-again",
        drift=0.0,
        parser=None,
        max_steps=30,
        image_size=None,
        rig="paper-five",
        seed=0,
        ground_floor=given,
    )
    assert made.ground_floor == given
