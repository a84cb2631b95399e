"""A search policy of one's own, as a function: along the building, always to the farthest free place."""

import math

from logisticsvln import LocalServices, Look, MissionSettings, NextStop, SearchTools, ahead
from logisticsvln.questions import SafeDistancesQuestion, ViewpointQuestion, ViewpointSettings


async def farthest_way(look: Look, tools: SearchTools) -> NextStop:
    views = tuple(sight.depth_view for sight in look.all)
    along = await tools.viewpoint(ViewpointQuestion(views=views, settings=ViewpointSettings(policy="paper")))
    sight = look.sights[along.camera]
    question = SafeDistancesQuestion(view=sight.depth_view, others=look.depth_beside(sight))
    way = max((await tools.safe_distances(question)).points, key=lambda point: point.distance_m)
    if way.distance_m < 1.0:
        return NextStop((), look.pose.yaw + math.radians(30), "turn left: no way is free")
    return NextStop((ahead(look.pose, way.bearing_deg, way.distance_m),), None, f"{way.distance_m:.1f} m on")


with LocalServices(oracle=True) as services:
    settings = MissionSettings(image_size=320, max_exploration_steps=12)
    flown = services.fly(sample="green-flower-pot", policy=farthest_way, vision="oracle", settings=settings)

print(f"{flown.result.search_policy}: {flown.result.outcome}, {flown.result.message}")
