"""Reads a LeRobot dataset with `datasets` and pandas, as LeRobot itself does: python read_lerobot.py ROOT OUT.npz"""

import json
import sys
from pathlib import Path

import datasets
import numpy as np
import pandas as pd

datasets.disable_progress_bars()
root, out = Path(sys.argv[1]), Path(sys.argv[2])
info = json.loads((root / "meta" / "info.json").read_text())
features = {}
for name, feature in info["features"].items():
    if feature["dtype"] == "image":
        features[name] = datasets.Image()
    elif feature["dtype"] != "video" and feature["shape"] == [1]:
        features[name] = datasets.Value(feature["dtype"])
    elif feature["dtype"] != "video":
        features[name] = datasets.Sequence(datasets.Value(feature["dtype"]), length=feature["shape"][0])
files = [str(path) for path in sorted((root / "data").glob("*/*.parquet"))]
cache = str(out.with_suffix(".cache"))
rows = datasets.Dataset.from_parquet(files, features=datasets.Features(features), cache_dir=cache)
read = {name: np.array([np.asarray(row) for row in rows[name]]) for name in features}
tasks = pd.read_parquet(root / "meta" / "tasks.parquet")
read["tasks"] = np.array(tasks.sort_values("task_index").index.tolist())
files = [str(path) for path in sorted((root / "meta" / "episodes").glob("*/*.parquet"))]
episodes = datasets.Dataset.from_parquet(files, cache_dir=cache)
assert episodes[0]["dataset_from_index"] == 0
assert episodes[-1]["dataset_to_index"] == len(rows) == info["total_frames"]
np.savez(out, **read)
