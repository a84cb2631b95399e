"""Places, poses and boxes, shared by all services."""

from typing import Literal, Self

from pydantic import model_validator

from contracts.base import Coordinate, Radians, Unit, Wire

PointLabel = Literal["a", "b", "c", "d", "e"]
"""One of the five marked points of a view, from left to right; c is straight ahead."""

POINT_LABELS: tuple[PointLabel, ...] = ("a", "b", "c", "d", "e")


class Point2(Wire):
    """A point of the ground plan, metres, ENU."""

    x: Coordinate
    y: Coordinate


class Point3(Wire):
    """A point in metres, ENU, z up from the ground."""

    x: Coordinate
    y: Coordinate
    z: Coordinate


class Pose(Wire):
    """Where the drone's centre is (metres, ENU) and where its nose points (radians, counter-clockwise from east)."""

    x: Coordinate
    y: Coordinate
    z: Coordinate
    yaw: Radians


class Box(Wire):
    """An image box in 0..1 of the width and the height, origin at the top left."""

    x_min: Unit
    y_min: Unit
    x_max: Unit
    y_max: Unit

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.x_min >= self.x_max or self.y_min >= self.y_max:
            raise ValueError("a box needs x_min < x_max and y_min < y_max")
        return self
