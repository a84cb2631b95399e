"""A model of one's own: it finds things by their colour. The embedded model counts floors and boxes the building."""

from collections.abc import Sequence

import cv2
import numpy as np

from logisticsvln import Box, CameraPicture, LocalServices, Match, MissionSettings, OwnVision

HUES = {"red": 0, "yellow": 27, "green": 65, "blue": 108, "purple": 140}
"""Degrees / 2, as OpenCV counts them."""


def by_colour(views: Sequence[CameraPicture], phrase: str) -> list[Match]:
    """The largest patch, over all views, of the phrase's colour: a jerrycan is as good as a watering can."""
    largest, matches = 40, []
    for view in views:
        hsv = cv2.cvtColor(view.rgb, cv2.COLOR_RGB2HSV).astype(int)
        near = abs(hsv[..., 0] - HUES[phrase.split()[0]]) < 12
        patch = (near & (hsv[..., 1] > 130) & (hsv[..., 2] > 60)).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(patch)
        x, y, width, height, area = max(stats[1:], key=lambda one: int(one[4]), default=(0, 0, 0, 0, 0))
        if view.camera is not None and area > largest:
            side, largest = view.rgb.shape[0], area
            box = Box(x_min=x / side, y_min=y / side, x_max=(x + width) / side, y_max=(y + height) / side)
            matches = [Match(camera=view.camera.name, box=box, confidence=0.9)]
    return matches


with LocalServices() as services:
    settings = MissionSettings(image_size=400)
    flown = services.fly(sample="tower-watering-can", vision=OwnVision(by_colour), settings=settings)

print(f"{flown.result.outcome}: {flown.result.message}")
print({role: calls.calls for role, calls in flown.result.model_calls.items()})
