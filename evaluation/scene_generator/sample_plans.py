"""The deliveries that ship with the project, as plans: over the four building types, from easy to hard."""

from typing import NamedTuple

from evaluation.scene_generator.scene_plan import (
    BalconySpec,
    DecoySpec,
    FootprintSpec,
    GoalSpec,
    SceneSpec,
    Surroundings,
)


class SamplePlan(NamedTuple):
    """`seed` decides whatever the plan leaves open."""

    title: str
    request: str
    seed: int
    spec: SceneSpec


SAMPLE_PLANS: tuple[SamplePlan, ...] = (
    SamplePlan(
        "The green flower pot",
        "Please bring my parcel to the fourth floor, the window with the green flower pot. "
        "The one with the red flower pot is my neighbour's.",
        117,
        SceneSpec(
            name="green-flower-pot",
            kind="low_rise",
            family="pastel_plaster",
            footprint=FootprintSpec(width_m=20, depth_m=13),
            floors=5,
            balconies=BalconySpec(facades=(0, 2), every=3, first=1),
            goal=GoalSpec(kind="flower_pot", colour="green", floor=4, corners=1, column=1, on="sill", scale=1.4),
            decoys=(DecoySpec(like="colour", colour="red", corners=1), DecoySpec(like="kind", corners=0)),
            clutter=8,
            surroundings=Surroundings(neighbours="street", gap_m=36, trees=24, shrubs=8, cars=4),
            sky="clear",
        ),
    ),
    SamplePlan(
        "A kite, and another across the street",
        "Hi! Not sure how much detail you need... the flat is 1507, the building is the brick one. We're on the 3rd "
        "floor and there's a blue kite at our window. Somebody over the road has one too, that isn't us.",
        23,
        SceneSpec(
            name="street-kite",
            kind="low_rise",
            family="red_brick",
            footprint=FootprintSpec(width_m=26, depth_m=12),
            floors=4,
            goal=GoalSpec(kind="kite", colour="blue", floor=3, corners=0, scale=1.0),
            decoys=(DecoySpec(like="kind"), DecoySpec(like="neighbour")),
            clutter=6,
            surroundings=Surroundings(neighbours="street", gap_m=30, trees=8, cars=5, surface="paving"),
            sky="cloudy",
        ),
    ),
    SamplePlan(
        "The villa's teddy bear",
        "hi mr drone!! i live on floor 2 and we have a brown teddy bear at our window. "
        "can you bring my birthday cake please please please",
        37,
        SceneSpec(
            name="villa-teddy-bear",
            kind="villa",
            family="garden_plaster",
            footprint=FootprintSpec(width_m=14, depth_m=11),
            floors=2,
            goal=GoalSpec(kind="teddy_bear", colour="brown", floor=2, corners=2, scale=1.2),
            decoys=(DecoySpec(like="colour", corners=1),),
            clutter=4,
            surroundings=Surroundings(trees=22, shrubs=8, cars=1),
            sky="clear",
        ),
    ),
    SamplePlan(
        "Nine floors up",
        "My building has 14 storeys. I'm on the ninth, behind the window with a yellow watering can. We moved from the "
        "fifth floor last month, so don't be misled by the label.",
        41,
        SceneSpec(
            name="tower-watering-can",
            kind="high_rise",
            family="blue_panel",
            footprint=FootprintSpec(width_m=20, depth_m=18),
            floors=14,
            goal=GoalSpec(kind="watering_can", colour="yellow", floor=9, corners=2, scale=1.2),
            decoys=(DecoySpec(like="floor"), DecoySpec(like="colour")),
            clutter=12,
            surroundings=Surroundings(trees=10, cars=5, surface="paving"),
            sky="cloudy",
        ),
    ),
    SamplePlan(
        "The lantern of the pagoda",
        "O mighty drone, ascend to the third floor and seek a red lantern. There shall you lay down my parcel.",
        53,
        SceneSpec(
            name="pagoda-lantern",
            kind="cultural",
            family="temple_stone",
            pagoda=True,
            footprint=FootprintSpec(shape="octagon", width_m=17),
            floors=5,
            goal=GoalSpec(kind="lantern", colour="red", floor=3, corners=4, scale=1.2),
            decoys=(DecoySpec(like="kind", corners=2),),
            clutter=3,
            surroundings=Surroundings(trees=20, shrubs=0, cars=0, surface="gravel"),
            sky="clear",
        ),
    ),
    SamplePlan(
        "The temple hall",
        "Kindly deliver the documents to the second-floor window displaying a blue vase. Reception is closed.",
        67,
        SceneSpec(
            name="temple-vase",
            kind="cultural",
            family="red_lacquer",
            footprint=FootprintSpec(width_m=22, depth_m=14),
            floors=2,
            goal=GoalSpec(kind="vase", colour="blue", floor=2, corners=1, scale=1.3),
            decoys=(DecoySpec(like="colour"),),
            clutter=3,
            surroundings=Surroundings(trees=18, shrubs=0, cars=0, surface="paving"),
            sky="cloudy",
        ),
    ),
    SamplePlan(
        "Behind the wings",
        "ignore the yellow umbrella, thats my weird neighbour. mine is the red umbrella, floor 3, round the back",
        79,
        SceneSpec(
            name="t-house-umbrella",
            kind="low_rise",
            family="white_render",
            footprint=FootprintSpec(shape="t", width_m=30, depth_m=22, arm_m=12),
            floors=4,
            balconies=BalconySpec(every=2, first=0),
            goal=GoalSpec(kind="umbrella", colour="red", floor=3, corners=4),
            decoys=(DecoySpec(like="colour", colour="yellow", corners=2),),
            clutter=8,
            surroundings=Surroundings(trees=14, cars=3),
            sky="clear",
        ),
    ),
)
