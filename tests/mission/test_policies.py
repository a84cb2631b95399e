"""Search policies by name, and the settings that each of them has."""

import pytest
from pydantic import ValidationError

from contracts.depth_assist import ApproachSettings
from contracts.orchestrator import MissionSettings
from mission.policies import DEFAULT, BadSearch, completed, policy_names, policy_of, words_of
from mission.policies.contour import ContourPolicy


def settings(**given: object) -> MissionSettings:
    return MissionSettings.model_validate(given)


def test_there_are_four_policies_and_one_of_them_is_the_default() -> None:
    assert policy_names() == ("paper", "random", "default", "contour")
    assert ContourPolicy.name == DEFAULT


def test_without_a_name_the_default_policy_is_meant_and_recorded_with_all_its_settings() -> None:
    made = completed(settings(viewpoint={"l_max_m": 7.0}))
    assert made.viewpoint.policy == DEFAULT
    assert made.viewpoint.constants["l_max_m"] == 7.0
    assert set(made.viewpoint.constants) == set(ContourPolicy.settings_type.model_fields)
    assert completed(made) == made


def test_a_setting_of_another_policy_never_chooses_that_one_silently() -> None:
    with pytest.raises(BadSearch, match="contour has no setting slices; paper has it: name the policy as well"):
        completed(settings(viewpoint={"slices": 30}))
    assert completed(settings(viewpoint={"policy": "paper", "slices": 30})).viewpoint.constants["slices"] == 30


@pytest.mark.parametrize("policy", ["random", "default"])
def test_an_ablation_refuses_the_constants_of_the_rule_that_it_does_without(policy: str) -> None:
    with pytest.raises(BadSearch, match=f"{policy} has no setting slices; paper has it"):
        completed(settings(viewpoint={"policy": policy, "slices": 30}))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"choice": "centre"}, "choice is a setting of a search policy"),
        ({"explore": {"l_max_m": 5.0}}, "explore is a setting of a search policy"),
        ({"safe_distances": {"clearance_m": 1.0}}, "safe_distances is a setting of a search policy"),
    ],
)
def test_what_only_some_policies_have_is_no_setting_of_the_mission(given: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        settings(**given)


def test_a_value_out_of_bounds_is_told_by_its_name() -> None:
    with pytest.raises(BadSearch, match=r"viewpoint\.slices: Input should be greater than or equal to 4"):
        completed(settings(viewpoint={"policy": "paper", "slices": 1}))
    with pytest.raises(BadSearch, match=r"viewpoint\.choice: Input should be 'model' or 'centre'"):
        completed(settings(viewpoint={"policy": "paper", "choice": "left"}))


def test_one_setting_of_the_approach_changes_nothing_else() -> None:
    assert settings(approach={"clearance_m": 0.8}).approach == MissionSettings().approach.model_copy(
        update={"clearance_m": 0.8}
    )
    assert MissionSettings().approach == ApproachSettings()


def test_a_search_is_told_by_its_label_and_what_is_not_as_usual() -> None:
    assert words_of(settings().viewpoint) == ["contour explorer"]
    assert words_of(settings(viewpoint={"policy": "paper", "choice": "centre"}).viewpoint) == [
        "paper's rule",
        "centre, no choice",
    ]
    assert words_of(settings(viewpoint={"policy": "paper", "slices": 30}).viewpoint) == ["paper's rule", "slices 30"]
    assert words_of(settings(viewpoint={"policy": "gone", "speed": 3}).viewpoint) == ["gone"]


def test_a_policys_settings_are_typed_where_it_uses_them() -> None:
    policy = policy_of(settings(viewpoint={"policy": "paper", "safe_distances": {"clearance_m": 1}}).viewpoint)
    assert policy.settings.safe_distances.clearance_m == 1.0
