"""A first flight: services on this machine, one delivery, what came of it."""

from logisticsvln import LocalServices, MissionSettings

with LocalServices() as services:
    flown = services.fly(
        "Please bring my parcel to the fourth floor, the window with the green flower pot.",
        sample="green-flower-pot",
        settings=MissionSettings(image_size=400),
    )

for event in flown.events:
    print(f"{event.time_s:6.1f} s  {event.phase:<8}  {event.message}")
print(f"{flown.result.outcome}: {flown.result.message}")
print(f"{flown.result.steps} stops, {flown.result.path_m:.0f} m; pictures and events are in {flown.folder}")
