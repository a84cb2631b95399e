"""The parameters of `navigation` at the contracts' defaults, as a question without settings of its own has them."""

from contracts.depth_assist import ApproachSettings, ExploreSettings, SafeDistanceSettings, ViewpointSettings
from contracts.orchestrator import MissionSettings
from navigation.approach import ApproachParameters
from navigation.explorer.parameters import ExplorerParameters
from navigation.floor_localization import FloorLocalizationParameters
from navigation.safe_distance import SafeDistanceParameters
from navigation.viewpoint import ViewpointParameters

VIEWPOINT = ViewpointParameters(**ViewpointSettings().model_dump())
SAFE_DISTANCE = SafeDistanceParameters(**SafeDistanceSettings().model_dump())
APPROACH = ApproachParameters(**ApproachSettings().model_dump(exclude={"sensor_range_m"}))  # the views are cut to it
EXPLORER = ExplorerParameters(**ExploreSettings().model_dump())
FLOOR_LOCALIZATION = FloorLocalizationParameters(reading=MissionSettings().band_reading)
