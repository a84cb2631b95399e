"""What is asked about a look follows from the street and the truth alone."""

import pytest

from contracts.sim import Catalogue, CatalogueEntry
from evaluation.model_evaluation.questions import UNKNOWN, Thing, questions, visible
from tests.evaluation.model_evaluation.test_evaluate_scores import case, look, thing


def entry(kind: str, *synonyms: str) -> CatalogueEntry:
    return CatalogueEntry(
        kind=kind,
        category="household",
        phrase=kind,
        synonyms=synonyms,
        colours=("red", "blue"),
        places=("sill",),
        size_m=(0.2, 0.2, 0.2),
    )


CATALOGUE = Catalogue(entries=(entry("mug", "cup"), entry("kettle", "teapot"), entry("vase")))
STREET = case(7, look(thing("mug", "red"), thing("kettle", "blue")))


def test_the_goal_comes_first_and_each_role_once() -> None:
    asked = questions(STREET, 0, CATALOGUE)
    assert [a.role for a in asked] == ["goal", "seen", "twin", "namesake", "unknown"]
    assert asked[0].phrase == "red mug"
    assert asked[1].thing == Thing("kettle", "blue")


def test_decoy_questions_ask_for_what_is_not_there_beside_what_is() -> None:
    for seed in range(20):
        street = case(seed, STREET.looks[0])
        seen = visible(street.looks[0])
        for asked in questions(street, 0, CATALOGUE):
            if asked.role == "twin":
                assert asked.thing not in seen
                assert asked.thing is not None
                assert any(asked.thing.kind == t.kind for t in seen)
            if asked.role == "namesake":
                assert asked.thing not in seen
                assert asked.thing is not None
                assert any(asked.thing.colour == t.colour for t in seen)


def test_the_same_street_is_asked_the_same_and_synonyms_occur() -> None:
    assert questions(STREET, 0, CATALOGUE) == questions(STREET, 0, CATALOGUE)
    said = {a.phrase for seed in range(30) for a in questions(case(seed, STREET.looks[0]), 0, CATALOGUE)}
    assert {"blue kettle", "blue teapot"} <= said


def test_only_the_first_look_is_asked_about_the_unknown() -> None:
    street = case(7, STREET.looks[0], STREET.looks[0])
    assert "unknown" not in [a.role for a in questions(street, 1, CATALOGUE)]


def test_nothing_is_asked_but_the_goal_where_nothing_shows() -> None:
    assert [a.role for a in questions(case(7, look(), look()), 1, CATALOGUE)] == ["goal"]


@pytest.mark.parametrize("name", UNKNOWN)
def test_unknown_things_are_in_no_catalogue(name: str) -> None:
    from services.sim.catalogue import entries

    known = {phrase.replace(" ", "") for e in entries() for phrase in (e.kind.replace("_", ""), e.phrase, *e.synonyms)}
    assert name.replace(" ", "") not in known
