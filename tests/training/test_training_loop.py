"""Training runs: what was interrupted ends as if it had not been; what is exported answers as the network did.

PyTorch is there only with the extra `train`, so what needs it is imported where it is used: `make test-train`.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime
import pytest

from services.sim.catalogue import CATALOGUE
from services.vlm_gateway.embedded.exported import Exported
from tests.training.test_crops_and_pieces import shard_with
from training.crop_store import collect

if TYPE_CHECKING:
    from training.nets import Proposer
    from training.training_loop import Plan, Trainer

pytestmark = [pytest.mark.train, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def plan() -> "Plan":
    from training.training_loop import Plan

    return Plan(steps=20, rate=1e-3, warm=3, save_every=4, log_every=5)


def same(a: "Trainer", b: "Trainer") -> bool:
    import torch

    ours, theirs = a.net.state_dict(), b.net.state_dict()
    smooth = all(torch.equal(a.smooth[k], b.smooth[k]) for k in a.smooth)
    return smooth and all(torch.equal(ours[k], theirs[k]) for k in ours)


def test_an_interrupted_proposer_ends_as_one_that_was_not(tmp_path: Path, plan: "Plan") -> None:
    import torch

    from training import fit_proposer

    shards = [shard_with(tmp_path, s) for s in (1, 2)]
    whole = fit_proposer.trainer(tmp_path / "whole", shards, plan, batch=2)
    whole.run()
    fit_proposer.trainer(tmp_path / "parts", shards, plan, batch=2).run(until=9)
    torch.manual_seed(99)  # another process has another chance
    resumed = fit_proposer.trainer(tmp_path / "parts", shards, plan, batch=2)
    assert resumed.step == 9
    resumed.run()
    assert resumed.step == whole.step == 20
    assert same(whole, resumed)


def test_an_interrupted_namer_ends_as_one_that_was_not_and_learns(tmp_path: Path, plan: "Plan") -> None:
    from training import fit_namer

    files = collect([shard_with(tmp_path, s) for s in (1, 2)], tmp_path / "crops", 10, context=1.6, min_px=24.0)
    whole = fit_namer.trainer(tmp_path / "whole", files, 10, 4, plan, batch=8)
    whole.run()
    fit_namer.trainer(tmp_path / "parts", files, 10, 4, plan, batch=8).run(until=11)
    resumed = fit_namer.trainer(tmp_path / "parts", files, 10, 4, plan, batch=8)
    resumed.run()
    assert same(whole, resumed)
    log = (tmp_path / "whole" / "namer-log.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(log) == 4
    assert float(log[-1].split('"loss": ')[1].split(",")[0]) < float(log[0].split('"loss": ')[1].split(",")[0])


def some_proposer() -> "Proposer":
    """Its normalisations have seen something, so that folding them into the convolutions matters."""
    import torch

    from training.nets import Proposer

    torch.manual_seed(1)
    net = Proposer().train()
    with torch.no_grad():
        for _ in range(8):
            net(torch.randint(0, 256, (2, 128, 128, 3), dtype=torch.uint8))
    return net.eval()


def test_in_integers_the_proposer_answers_nearly_as_it_did(tmp_path: Path) -> None:
    import onnx
    import torch

    from training.export import write_proposer
    from training.nets import ProposerAnswer

    rng = np.random.default_rng(0)
    blocks = rng.integers(0, 256, (6, 32, 32, 3), dtype=np.uint8)
    pictures = blocks.repeat(8, axis=1).repeat(8, axis=2)
    proposer = some_proposer()
    write_proposer(proposer, tmp_path / "proposer.onnx", pictures[:4])
    assert [path.name for path in tmp_path.iterdir()] == ["proposer.onnx"]
    weights = onnx.load(str(tmp_path / "proposer.onnx")).graph.initializer
    bytes_of = {kind: sum(len(w.raw_data) for w in weights if w.data_type == kind) for kind in (1, 3)}
    assert bytes_of[onnx.TensorProto.INT8] > 20 * bytes_of[onnx.TensorProto.FLOAT]
    said = onnxruntime.InferenceSession(str(tmp_path / "proposer.onnx")).run(
        ["objectness", "box", "building", "window", "row"], {"pictures": pictures[4:]}
    )
    with torch.no_grad():
        expected = ProposerAnswer(proposer)(torch.from_numpy(pictures[4:]))
    for ours, theirs in zip(said, expected, strict=True):
        assert np.abs(ours - theirs.numpy()).mean() < 0.1 * theirs.numpy().std()


def test_exported_networks_answer_as_they_did(tmp_path: Path) -> None:
    import torch

    from training.export import write_float_proposer, write_namer
    from training.int8 import Arranged
    from training.nets import Namer, ProposerAnswer

    proposer, namer = some_proposer(), Namer(7, 4).eval()
    write_float_proposer(Arranged(proposer), tmp_path / "proposer.onnx")
    write_namer(namer, tmp_path / "namer.onnx")
    rng = np.random.default_rng(0)
    for shape in ((1, 320, 384, 3), (3, 256, 256, 3)):
        pictures = rng.integers(0, 256, shape, dtype=np.uint8)
        said = onnxruntime.InferenceSession(str(tmp_path / "proposer.onnx")).run(
            ["objectness", "box", "building", "window", "row"], {"pictures": pictures}
        )
        with torch.no_grad():
            expected = ProposerAnswer(proposer)(torch.from_numpy(pictures))
        for ours, theirs in zip(said, expected, strict=True):
            assert ours == pytest.approx(theirs.numpy(), abs=1e-3)
    crops = rng.integers(0, 256, (5, 64, 64, 3), dtype=np.uint8)
    said = onnxruntime.InferenceSession(str(tmp_path / "namer.onnx")).run(["kind", "colour", "box"], {"crops": crops})
    with torch.no_grad():
        for ours, theirs in zip(said, namer(torch.from_numpy(crops)), strict=True):
            assert ours == pytest.approx(theirs.numpy(), abs=1e-3)


def test_the_description_names_every_class_and_colour_of_the_catalogue(tmp_path: Path) -> None:
    from training.export import plain_model, write_model

    model = plain_model("2-test")
    write_model(model, tmp_path)
    assert Exported.load(tmp_path) == model
    assert model.kinds == tuple(e.kind for e in CATALOGUE.entries)
    assert {c for e in CATALOGUE.entries for c in e.colours} == set(model.colours)
