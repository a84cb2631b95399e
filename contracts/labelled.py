"""Pictures with what is really in them: how training and measuring data passes from the simulator's side to a model's.

A folder of such data holds the pictures as JPEG files and one `labels.jsonl` with a LabelledView a line.
"""

from contracts.base import Name, Wire
from contracts.geometry import Pose
from contracts.sim import TruthView

LABELS_FILE = "labels.jsonl"


class LabelledView(Wire):
    """One picture of a scene. `picture` is its file's name; `frontal` says that the camera faces the facade squarely,
    as when floors are counted; `seed` is the scene's."""

    picture: str
    scene: Name
    seed: int
    frontal: bool
    pose: Pose
    truth: TruthView
