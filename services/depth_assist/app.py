"""The endpoints of depth_assist: decode, call `navigation`, encode."""

from collections.abc import Sequence

import numpy as np
from fastapi import FastAPI
from fastapi.responses import Response
from numpy.typing import NDArray

from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    DirectionPoint,
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    Split,
    ViewDepth,
    ViewpointAnswer,
    ViewpointQuestion,
    ViewScore,
)
from contracts.geometry import POINT_LABELS, VIEW_HEADINGS_DEG, Point3
from contracts.images import BadImage, decode_depth, decode_depth_units
from navigation import approach, safe_distance, viewpoint
from navigation.camera import DepthView, Place, Pose, pinhole
from navigation.target import Box
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion
from service_kit.json_route import JsonRoute
from services.depth_assist.explorer import next_step

MAX_VIEW_PIXELS = 1600 * 1600


def build_app(*, max_body_bytes: int, token: str | None = None) -> FastAPI:
    """The service. It needs nothing else, so it is ready as soon as it answers."""
    app = create_app("depth_assist", max_body_bytes=max_body_bytes, token=token)
    app.router.route_class = JsonRoute

    @app.post("/v1/viewpoint", response_model=ViewpointAnswer)
    def viewpoint_(question: ViewpointQuestion) -> Response:
        """Which view to follow next (eq. 4-6)."""
        return json_response(choose_viewpoint(question))

    @app.post("/v1/safe-distances", response_model=SafeDistancesAnswer)
    def safe_distances_(question: SafeDistancesQuestion) -> Response:
        """How far one may fly towards each of the five marked points (eq. 7)."""
        return json_response(measure_safe_distances(question))

    @app.post("/v1/approach", response_model=ApproachAnswer)
    def approach_(question: ApproachQuestion) -> Response:
        """The way to a stop in front of the thing in the box."""
        return json_response(plan_approach(question))

    @app.post("/v1/explore", response_model=ExploreAnswer)
    def explore_(question: ExploreQuestion) -> Response:
        """The contour explorer's next stop; the map goes out with it and comes back with the next question."""
        return json_response(explore_step(question))

    return app


def choose_viewpoint(question: ViewpointQuestion) -> ViewpointAnswer:
    """Raises BadQuestion for views that can't be read, sliced or told apart."""
    asked = question.settings
    settings = viewpoint.Settings(**asked.model_dump())
    _check_views(question.views)
    sliced = {
        str(view.heading_deg): viewpoint.Sliced(view.heading_deg, _slice_means(view, question, settings))
        for view in question.views
    }
    choice = viewpoint.choose_view(sliced, settings, question.d_max_m, np.random.default_rng(question.seed))
    return ViewpointAnswer(
        heading_deg=_HEADINGS[int(choice.name)],
        reason=choice.reason,
        d_max_m=choice.d_max_m,
        d_max_next_m=choice.d_max_next_m,
        views=tuple(
            ViewScore(
                heading_deg=_HEADINGS[int(name)],
                slice_means_m=tuple(None if np.isnan(mean) else float(mean) for mean in sliced[name].means_m),
                splits=tuple(Split(**split._asdict()) for split in score.splits),
                best_j=None if score.best is None else score.best.j,
            )
            for name, score in choice.scores.items()
        ),
    )


def measure_safe_distances(question: SafeDistancesQuestion) -> SafeDistancesAnswer:
    """Raises BadQuestion for views that can't be read or told apart."""
    _check_views((question.view, *question.others))
    settings = safe_distance.Settings(**question.settings.model_dump())
    view, *others = _depth_views((question.view, *question.others), settings.sensor_range_m)
    if view.depth_m.shape[1] < len(POINT_LABELS) + 1:
        raise BadQuestion(f"a view of {view.depth_m.shape[1]} columns is too narrow for five points", code="bad_depth")
    marked = safe_distance.safe_distances(view, others, settings)
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
    _check_views((question.view, *question.others))
    asked = question.settings
    settings = approach.Settings(
        drone_radius_m=asked.drone_radius_m,
        clearance_m=asked.clearance_m,
        stop_distance_m=asked.stop_distance_m,
        height_slack_m=asked.height_slack_m,
    )
    view, *others = _depth_views((question.view, *question.others), asked.sensor_range_m)
    box = Box(question.box.x_min, question.box.y_min, question.box.x_max, question.box.y_max)
    pose = Pose(question.pose.x, question.pose.y, question.pose.z, question.pose.yaw)
    found = approach.plan_approach(view, others, box, pose, settings, question.max_leg_m)
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
    _check_views(question.views)
    return next_step(question, _depth_views(question.views, question.settings.sensor_range_m))


_HEADINGS = {int(heading): heading for heading in VIEW_HEADINGS_DEG}


def _check_views(views: Sequence[ViewDepth]) -> None:
    headings = [view.heading_deg for view in views]
    if len(set(headings)) < len(headings):
        raise BadQuestion(f"two views share a heading: {headings}; send each camera once", code="duplicate_heading")
    for view in views:
        width, height = view.depth.width, view.depth.height
        if width * height > MAX_VIEW_PIXELS:
            raise BadQuestion(
                f"the depth map at {view.heading_deg} degrees has {width} x {height} pixels; "
                f"at most {MAX_VIEW_PIXELS} are read",
                code="depth_too_large",
            )


def _slice_means(view: ViewDepth, question: ViewpointQuestion, settings: viewpoint.Settings) -> NDArray[np.float64]:
    depth, box = view.depth, question.building_box
    rows = None if box is None else viewpoint.row_range(box.y_min, box.y_max, depth.height)
    try:
        units = decode_depth_units(depth)
        return viewpoint.slice_means(units, depth.metres_per_unit, settings.slices, settings.sensor_range_m, rows)
    except (BadImage, ValueError) as error:
        raise _bad_depth(view, error) from None


def _depth_views(views: Sequence[ViewDepth], sensor_range_m: float) -> list[DepthView]:
    """Depth in metres; what lies beyond the sensor's range counts as no return."""
    decoded = []
    for view in views:
        try:
            depth_m = decode_depth(view.depth)
        except BadImage as error:
            raise _bad_depth(view, error) from None
        with np.errstate(invalid="ignore"):
            depth_m[depth_m > sensor_range_m] = np.inf
        decoded.append(DepthView(pinhole(view.depth.width, view.depth.height, 90.0, view.heading_deg), depth_m))
    return decoded


def _bad_depth(view: ViewDepth, error: ValueError) -> BadQuestion:
    return BadQuestion(f"the view at {view.heading_deg} degrees: {error}", code="bad_depth")


def _point(place: Place) -> Point3:
    return Point3(x=place.x, y=place.y, z=place.z)
