"""The explorer's free constants, in one place."""

from typing import NamedTuple


class ExplorerParameters(NamedTuple):
    """Lengths in metres, angles in degrees.

    Flight: `l_max_m` caps a move, `min_move_m` is the shortest worth flying; the drone is a ball of `drone_radius_m`,
    kept `clearance_m` from everything on a planned way and at least `tight_clearance_m` near where it hovers.
    Depth: what lies up to `band_m` above or below the camera is facade; what lies up to `body_band_m` is in the
    drone's way; `map_range_m` is how far returns are drawn into the map, `sensor_range_m` what counts as a return.
    Inspection: facade counts as seen up to `inspect_range_m` and `inspect_incidence_deg` from its normal; plans keep
    `plan_range_share` of the range and `plan_incidence_slack_deg` of the angle in reserve. What lies within `beside_m`
    of it counts as well.
    Expectation: `hidden_face_m` of wall is expected round an edge, `straight_on_m` behind an occluder or the picture's
    end; `bridge_m` is the widest gap between two collinear pieces that is taken for one wall. Smaller pieces than
    `min_patch_m` are not worth a stop.
    Choice: gain / (way + `gain_bias_m`); gains under `min_gain_m` wait, gains over `gain_cap_m` count as that.
    `stand_off_cost`: what a metre costs that the place lies farther from the walls than it must; whoever goes out wide
    flies the next corner wide as well.
    `unknown_cost`: what a metre through unknown country costs. `cut_m`: how long the line out of the first facade is
    that the drone does not cross back over, unless that saves more than `detour_m`. `attempts`: stops that failed to
    show a piece before it is given up.
    """

    l_max_m: float
    min_move_m: float
    drone_radius_m: float
    clearance_m: float
    tight_clearance_m: float
    sensor_range_m: float
    inspect_range_m: float
    inspect_incidence_deg: float
    band_m: float = 0.5
    body_band_m: float = 1.2
    map_range_m: float = 45.0
    beside_m: float = 0.5
    plan_range_share: float = 0.965
    plan_incidence_slack_deg: float = 3.0
    hidden_face_m: float = 8.0
    straight_on_m: float = 5.0
    bridge_m: float = 8.0
    min_patch_m: float = 1.6
    gain_bias_m: float = 8.0
    min_gain_m: float = 3.0
    gain_cap_m: float = 14.0
    stand_off_cost: float = 2.0
    unknown_cost: float = 1.3
    cut_m: float = 40.0
    detour_m: float = 20.0
    attempts: int = 2
    relax_rounds: int = 2

    @property
    def plan_range_m(self) -> float:
        return self.inspect_range_m * self.plan_range_share

    @property
    def plan_incidence_deg(self) -> float:
        return self.inspect_incidence_deg - self.plan_incidence_slack_deg

    @property
    def way_clearance_m(self) -> float:
        """From the drone's centre, with half a map cell for the grid's rounding."""
        return self.drone_radius_m + self.clearance_m + 0.25

    @property
    def tight_way_clearance_m(self) -> float:
        return self.drone_radius_m + self.tight_clearance_m
