from pathlib import Path

import pytest

from contracts.orchestrator import Sample
from contracts.scene import WindowPlace
from evaluation.scene_generator.footprints import corners_between
from evaluation.scene_generator.make_samples import SAMPLES, main, make_sample
from evaluation.scene_generator.sample_plans import SAMPLE_PLANS, SamplePlan
from services.sim.catalogue import CATALOGUE


def shipped() -> list[Sample]:
    return [Sample.model_validate_json(p.read_text(encoding="utf-8")) for p in sorted(SAMPLES.glob("*.json"))]


@pytest.mark.parametrize("plan", SAMPLE_PLANS, ids=lambda p: p.spec.name)
def test_every_shipped_sample_is_what_its_plan_builds(plan: SamplePlan) -> None:
    written = Sample.model_validate_json((SAMPLES / f"{plan.spec.name}.json").read_text(encoding="utf-8"))
    built = make_sample(plan, CATALOGUE)
    assert written.model_dump(exclude={"scene"}) == built.model_dump(exclude={"scene"})
    assert written.scene.model_dump(exclude={"objects"}) == built.scene.model_dump(exclude={"objects"})
    assert written.scene.objects[0] == built.scene.objects[0]


def test_the_samples_range_over_building_types_and_difficulties() -> None:
    samples = shipped()
    assert len(samples) == len(SAMPLE_PLANS) >= 6
    assert {s.scene.building(s.scene.target).kind for s in samples} == {"low_rise", "high_rise", "villa", "cultural"}
    assert {s.difficulty for s in samples} == {"easy", "moderate", "hard"}
    assert len({s.scene.building(s.scene.target).style.wall for s in samples}) >= 4


@pytest.mark.parametrize("sample", shipped(), ids=lambda s: s.name)
def test_a_samples_request_names_its_goal_and_its_lap_is_clockwise(sample: Sample) -> None:
    goal = next(o for o in sample.scene.objects if o.id == sample.scene.goal)
    entry = next(e for e in CATALOGUE.entries if e.kind == goal.kind)
    words = sample.request.lower()
    assert goal.colour in words
    assert any(name.lower() in words for name in (entry.phrase, *entry.synonyms))
    assert isinstance(goal.place, WindowPlace)
    assert goal.place.building == sample.scene.target
    count = len(sample.scene.building(sample.scene.target).footprint)
    clockwise = corners_between(count, 0, goal.place.facade, "clockwise")
    assert clockwise == corners_between(count, 0, goal.place.facade)


def test_the_command_writes_one_file_a_sample(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    catalogue = tmp_path / "catalogue.json"
    catalogue.write_text(CATALOGUE.model_dump_json(), encoding="utf-8")
    assert main(["--catalogue", str(catalogue), "--out", str(tmp_path / "out")]) == 0
    assert (
        len(capsys.readouterr().out.splitlines()) == len(list((tmp_path / "out").glob("*.json"))) == len(SAMPLE_PLANS)
    )
