"""The endpoints of depth_assist: decode, call `navigation`, encode."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from fastapi import FastAPI
from fastapi.responses import Response
from pydantic import BaseModel, ValidationError

from contracts.base import FARTHEST_M
from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    DirectionPoint,
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    Split,
    ViewpointAnswer,
    ViewpointQuestion,
    ViewScore,
)
from contracts.geometry import POINT_LABELS, Point3
from navigation import approach, safe_distance, viewpoint
from navigation.camera import Place, Pose
from navigation.keep_out import volumes
from navigation.target import Box
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion
from service_kit.json_route import JsonRoute
from services.depth_assist.explorer import next_step
from services.depth_assist.views import ahead, checked, depth_views, front_rows, level, slice_means

Q = TypeVar("Q", bound=BaseModel)
A = TypeVar("A", bound=BaseModel)


def build_app(*, max_body_bytes: int, token: str | None = None) -> FastAPI:
    """The service. It needs nothing else, so it is ready as soon as it answers."""
    app = create_app("depth_assist", max_body_bytes=max_body_bytes, token=token)
    app.router.route_class = JsonRoute

    @app.post("/v1/viewpoint", response_model=ViewpointAnswer)
    def viewpoint_(question: ViewpointQuestion) -> Response:
        """Which view to follow next (eq. 4-6)."""
        return json_response(_in_the_world(choose_viewpoint, question))

    @app.post("/v1/safe-distances", response_model=SafeDistancesAnswer)
    def safe_distances_(question: SafeDistancesQuestion) -> Response:
        """How far one may fly towards each of the five marked points (eq. 7)."""
        return json_response(_in_the_world(measure_safe_distances, question))

    @app.post("/v1/approach", response_model=ApproachAnswer)
    def approach_(question: ApproachQuestion) -> Response:
        """The way to a stop in front of the thing in the box."""
        return json_response(_in_the_world(plan_approach, question))

    @app.post("/v1/explore", response_model=ExploreAnswer)
    def explore_(question: ExploreQuestion) -> Response:
        """The contour explorer's next stop; the map goes out with it and comes back with the next question."""
        return json_response(_in_the_world(explore_step, question))

    return app


def _in_the_world(answer: Callable[[Q], A], question: Q) -> A:
    """The answer. Raises BadQuestion where a place in it would lie further out than places on the wire may."""
    try:
        return answer(question)
    except ValidationError as error:
        if any(one["type"] not in ("less_than_equal", "greater_than_equal") for one in error.errors()):
            raise
        raise BadQuestion(
            f"the answer would lie beyond {FARTHEST_M:,.0f} m from the origin: the pose or what is seen from it is too "
            "near to that edge; choose an origin near the drone's start",
            code="out_of_the_world",
        ) from None


def choose_viewpoint(question: ViewpointQuestion) -> ViewpointAnswer:
    """Raises BadQuestion for views that can't be read, sliced or told apart, and where none is level."""
    asked = question.settings
    settings = viewpoint.ViewpointParameters(**asked.model_dump())
    views = level(checked(question.views))
    rows = {} if question.building_box is None else front_rows(ahead(views), views, question.building_box)
    means = slice_means(views, settings, rows)
    sliced = {view.camera.name: viewpoint.Sliced(view.camera.heading_deg, means[view.camera.name]) for view in views}
    choice = viewpoint.choose_view(sliced, settings, question.d_max_m, np.random.default_rng(question.seed))
    return ViewpointAnswer(
        camera=choice.name,
        heading_deg=choice.heading_deg,
        reason=choice.reason,
        d_max_m=choice.d_max_m,
        d_max_next_m=choice.d_max_next_m,
        views=tuple(
            ViewScore(
                camera=name,
                heading_deg=sliced[name].heading_deg,
                slice_means_m=tuple(None if np.isnan(mean) else float(mean) for mean in sliced[name].means_m),
                splits=tuple(Split(**split._asdict()) for split in score.splits),
                best_j=None if score.best is None else score.best.j,
            )
            for name, score in choice.scores.items()
        ),
    )


def measure_safe_distances(question: SafeDistancesQuestion) -> SafeDistancesAnswer:
    """Raises BadQuestion for views that can't be read or told apart."""
    asked = checked((question.view, *question.others))
    level(asked[:1])
    settings = safe_distance.SafeDistanceParameters(**question.settings.model_dump())
    view, *others = depth_views(asked, settings.sensor_range_m)
    marked = safe_distance.safe_distances(view, others, settings, question.height_m)
    return SafeDistancesAnswer(
        points=tuple(
            DirectionPoint(
                label=label,
                x=point.x,
                y=point.y,
                bearing_deg=point.bearing_deg,
                distance_m=point.corridor.distance_m,
                nearest_return_m=point.corridor.nearest_return_m,
                corridor_half_width_m=point.corridor.half_width_m,
            )
            for label, point in zip(POINT_LABELS, marked, strict=True)
        )
    )


def plan_approach(question: ApproachQuestion) -> ApproachAnswer:
    """Raises BadQuestion for views that can't be read or told apart."""
    views = checked((question.view, *question.others))
    asked = question.settings
    settings = approach.ApproachParameters(
        drone_radius_m=asked.drone_radius_m,
        clearance_m=asked.clearance_m,
        stop_distance_m=asked.stop_distance_m,
        height_slack_m=asked.height_slack_m,
    )
    view, *others = depth_views(views, asked.sensor_range_m)
    box = Box(question.box.x_min, question.box.y_min, question.box.x_max, question.box.y_max)
    pose = Pose(question.pose.x, question.pose.y, question.pose.z, question.pose.yaw)
    kept_out = volumes(question.keep_out)
    found = approach.plan_approach(view, others, box, pose, settings, question.max_leg_m, kept_out)
    if found.target is None:
        return ApproachAnswer(status="no_depth")
    return ApproachAnswer(
        status=found.status,
        target=_point(found.target.place),
        facing_yaw=found.target.facing_yaw,
        plane_share=found.target.plane_share,
        stop=None if found.stop is None else _point(found.stop),
        path=tuple(_point(place) for place in found.path),
        aside=tuple(_point(place) for place in found.aside),
        reached=found.reached,
        target_distance_m=found.target.distance_m,
        free_distance_m=found.free_distance_m,
    )


def explore_step(question: ExploreQuestion) -> ExploreAnswer:
    """Raises BadQuestion for views that can't be read or told apart, and for a map that is none."""
    views = checked(question.views)
    front = ahead(level(views))
    return next_step(question, depth_views(views, question.settings.sensor_range_m), front)


def _point(place: Place) -> Point3:
    return Point3(x=place.x, y=place.y, z=place.z)
