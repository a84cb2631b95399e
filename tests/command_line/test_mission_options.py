"""Which search the command line's options make."""

import pytest

from command_line.mission_options import ChoicePolicy, ViewpointPolicy, mission_settings
from contracts.orchestrator import MissionSettings


def settings(viewpoint: ViewpointPolicy | None = None, choice: ChoicePolicy | None = None) -> MissionSettings:
    return mission_settings(
        viewpoint=viewpoint,
        choice=choice,
        floors="stepwise",
        sightings="look-again",
        drift=0.0,
        parser=None,
        max_steps=30,
        image_size=800,
        seed=0,
    )


def test_without_options_the_settings_are_those_of_a_mission_over_rest() -> None:
    assert settings() == MissionSettings()
    assert settings().viewpoint.policy == "contour"


@pytest.mark.parametrize(
    ("viewpoint", "choice", "policy"),
    [(None, "centre", "paper"), (None, "model", "paper"), ("random", "centre", "random"), ("default", None, "default")],
)
def test_a_choice_goes_with_the_papers_rule(
    viewpoint: ViewpointPolicy | None, choice: ChoicePolicy | None, policy: str
) -> None:
    made = settings(viewpoint, choice)
    assert made.viewpoint.policy == policy
    assert made.choice == (choice or "model")


def test_the_explorer_offers_nothing_to_choose_from() -> None:
    with pytest.raises(ValueError, match="--viewpoint paper"):
        settings("contour", "centre")
