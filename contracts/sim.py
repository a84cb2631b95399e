"""sim: what a trial in the simulator adds to its vehicle: the scene, the judging of a claim, and, where switched on,
the truth. How the vehicle is flown is in `contracts.vehicle`; its base address is `/v1/episodes/{id}`.

    POST   /v1/episodes             Episode; EpisodeQuestion
    GET    /v1/episodes/{id}/trial  Episode
    POST   /v1/episodes/{id}/renew  Episode; a sign of life of whoever flies it, and nothing else
    PUT    /v1/episodes/{id}/pose   PoseJudged; PoseReport: where somebody else's autopilot has flown the drone to
    POST   /v1/episodes/{id}/claim  Verdict; Claim
    POST   /v1/episodes/{id}/truth  Truth; TruthQuestion; only where it is switched on
    DELETE /v1/episodes?key=...     frees the episode that was begun, or is being begun, under a key; `owner=...` all
                                    that were begun for an owner

Whoever flies an episode holds it by a lease: every call on it renews the lease, and where calls are far apart, because
a model thinks, `renew` does. An episode whose lease has run out is ended.
"""

from typing import Literal

from pydantic import Field

from contracts.base import Name, Wire
from contracts.cameras import MAX_CAMERAS, Camera, Rig, default_rig
from contracts.geometry import Box, Point3, Pose
from contracts.scene import Scene
from contracts.sensor_profiles import DEFAULT_SENSORS, SensorFault, Sensors, SensorsOrName, shipped_sensors
from contracts.vehicle import VehicleState

Renderer = Literal["moderngl", "tiny", "carla"]
MAX_LEASE_S = 86_400.0
SUCCESS_RADIUS_M = 3.0
"""How near to its window's centre a delivery ends."""
SUCCESS_ASIDE_DEG = 60.0
"""How far off the window's normal it may end."""


class Flight(Wire):
    """How the drone flies: a sphere of `radius_m` on a path with bounded speed, acceleration and yaw rate. `model`:
    `kinematic`, exactly along the path, whatever the wind; `quadrotor`, a body that follows it as its thrust, its tilt
    and the wind let it; null: `quadrotor` where the scene has wind. `drift`: how far the pose it reports strays per
    metre flown, in a direction drawn from the scene's seed and `drift_seed`; success is judged by the true pose.
    `endurance_s`: of hovering on a full battery, of which `reserve` is there to get home by; an empty one only lands.
    `pace`: seconds of wall time for a second of flight; 0 flies as fast as it can be computed, 1 as it would be
    watched."""

    model: Literal["kinematic", "quadrotor"] | None = None
    radius_m: float = Field(default=0.35, gt=0.05, le=1.0)
    max_speed_m_s: float = Field(default=4.0, gt=0.1, le=20.0)
    max_acceleration_m_s2: float = Field(default=2.5, gt=0.1, le=20.0)
    max_yaw_rate_rad_s: float = Field(default=1.5, gt=0.1, le=10.0)
    drift: float = Field(default=0.0, ge=0.0, le=0.1)
    drift_seed: int = Field(default=0, ge=0, le=2**31 - 1)
    endurance_s: float = Field(default=1500.0, ge=1.0, le=86_400.0)
    reserve: float = Field(default=0.2, ge=0.0, le=0.9)
    pace: float = Field(default=0.0, ge=0.0, le=100.0)


class EpisodeTerms(Wire):
    """Under which name, for whom and for how long an episode is held, in whatever world. `key`: the caller's own name
    for it; the same key and question again is the same episode, so that asking twice begins nothing twice. `owner`: for
    whom it is begun; a world may bound how many episodes one has. Whoever knows key or owner can end it: choose names
    that nobody guesses. `lease_s`: seconds without a call until it is ended; the world's usual ones without it."""

    key: Name | None = None
    owner: Name | None = None
    lease_s: float | None = Field(default=None, ge=1.0, le=MAX_LEASE_S)


class EpisodeQuestion(EpisodeTerms):
    """A drone with these cameras and sensors at the start of a scene. `sensors`: a profile, or a shipped one's name;
    null: as the scene says. `seed`: of their chance, beside the scene's own. `faults`: for tests. `own_request`: the
    customer's words are not those that the scene's goal was set for, so that the verdict has to tell what stands at the
    window claimed (`Verdict.window`)."""

    scene: Scene
    flight: Flight = Flight()
    rig: Rig = Field(default_factory=default_rig)
    sensors: SensorsOrName = None
    seed: int = Field(default=0, ge=0, le=2**31 - 1)
    faults: tuple[SensorFault, ...] = Field(default=(), max_length=16)
    own_request: bool = Field(default=False, exclude_if=lambda own: not own)

    @property
    def sensors_flown(self) -> Sensors:
        """The profile chosen here, else the scene's, else the perfect one."""
        return self.sensors or shipped_sensors(self.scene.sensors or DEFAULT_SENSORS)


class Episode(Wire):
    """What a trial adds to its vehicle. `id` is the vehicle's name; `status`: `flying` until a claim ends it
    (`claimed`); `sensors` names profile and version; without a call it is ended after `expires_in_s`, of a lease of
    `lease_s`."""

    id: Name
    status: Literal["flying", "claimed"]
    scene: str
    renderer: Renderer
    renderer_detail: str
    flight: Flight
    rig: Name
    sensors: Name
    lease_s: float
    expires_in_s: float
    vehicle: VehicleState


class PoseReport(Wire):
    """Where the drone is now, in the scene, when an autopilot outside flies it: looks are drawn from there, and a claim
    is judged there. What lies on the straight way from the last pose is hit. `grounded`: it stands on the ground, or is
    starting or landing, so that touching the ground is no collision."""

    pose: Pose
    grounded: bool = False


class PoseJudged(Wire):
    """`hit`: what lies on the way to the pose that was reported; null where nothing does. `collided` never goes back to
    false."""

    collided: bool
    hit: str | None


class Claim(Wire):
    """The mission says: this is the window. Ends the episode, so nothing can be learnt by trying. `target` is where
    the mission believes the object to be."""

    target: Point3 | None = None


class Shown(Wire):
    """What stands at a window: its floor, and all that people call the things there, such as "red flower pot"."""

    floor: int
    names: tuple[str, ...] = Field(max_length=200)


class ClaimedWindow(Wire):
    """For a request of the customer's own: what stands at the window claimed and at the goal's, if the scene has one,
    and how the drone stands to the one claimed (the other fields as in `Verdict`). Told when the episode is over, so
    that nothing can be learnt by it."""

    claimed: Shown
    goal: Shown | None
    distance_m: float
    in_front: bool
    line_of_sight: bool
    nearest_window: bool | None
    aside_deg: float | None


class Verdict(Wire):
    """`delivered` is success: the right window claimed, within 3 m of its centre, no other window of any building
    nearer to the stop, within 60 degrees of its normal, in front of it, in clear sight, never collided. `judged` is
    false for a scene without a goal: nothing is delivered there, and the rest tells of the window that is nearest to
    the claim. `aside_deg`: between the window's normal and the way to the stop. `steps`: stops with a look, as the
    world counts them. `window`: of a request of the customer's own. Verdicts of version 0.2 have neither
    `nearest_window`, `aside_deg` nor `steps`: null."""

    judged: bool
    delivered: bool
    right_window: bool | None
    distance_m: float | None
    in_front: bool
    line_of_sight: bool
    collided: bool
    nearest_window: bool | None = None
    aside_deg: float | None = Field(default=None, ge=0.0, le=180.0)
    steps: int | None = Field(default=None, ge=0)
    window: ClaimedWindow | None = Field(default=None, exclude_if=lambda window: window is None)

    def stops_well(self, radius_m: float = SUCCESS_RADIUS_M) -> bool:
        """Everything but which window was meant, with another radius where one is asked for."""
        if self.distance_m is None or self.distance_m > radius_m or self.nearest_window is False:
            return False
        aside = self.aside_deg is not None and self.aside_deg > SUCCESS_ASIDE_DEG
        return self.in_front and not aside and self.line_of_sight and not self.collided


class TruthQuestion(Wire):
    """For the `oracle` back end only; the route exists only where the truth is switched on. `cameras`: what is shown to
    whom, as they look from where the drone is now; headings are relative to its nose, whatever its own rig is.
    `candidates`: places whose remaining way to the goal is wanted."""

    cameras: tuple[Camera, ...] = Field(default=(), max_length=MAX_CAMERAS)
    candidates: tuple[Point3, ...] = Field(default=(), max_length=16)


class VisibleObject(Wire):
    """An object's visible pixels in one view; `share` is how much of its outline is not hidden or cut off. `goal`: it
    is what was asked for, or like that and at another window of the same floor and building."""

    id: str
    kind: str
    colour: str
    goal: bool
    box: Box
    pixels: int
    share: float
    distance_m: float


class TruthView(Wire):
    """What the camera of that name shows. `floor_rows`: 0..1 from the top, the lowest floor first."""

    camera: Name
    objects: tuple[VisibleObject, ...]
    building_box: Box | None
    floors_visible: int
    floor_rows: tuple[float, ...]


class Truth(Wire):
    """`views`: of the question's cameras, in their order. `remaining_m` is the shortest collision-free way from each
    candidate to the goal's window; null if there is none. `scene` and `moves` say where and when: the scene's name, and
    how many moves the drone has made."""

    scene: str = ""
    moves: int = 0
    pose: Pose
    views: tuple[TruthView, ...]
    remaining_m: tuple[float | None, ...]


class CatalogueEntry(Wire):
    """One class of object: its category, the colours it comes in, what people call it, where it can be put."""

    kind: Name
    category: Literal["tools", "containers", "household", "food", "furniture", "posters", "toys", "ornaments"]
    phrase: str
    synonyms: tuple[str, ...]
    colours: tuple[str, ...]
    places: tuple[Literal["sill", "balcony", "wall", "pane", "hang", "free"], ...]
    size_m: tuple[float, float, float]


class Catalogue(Wire):
    entries: tuple[CatalogueEntry, ...]
