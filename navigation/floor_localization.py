"""Floor localization (eq. 3): from floor counts of non-overlapping vertical bands to the height of a window.

How eq. 3 is read here: band i (1, 2, ...) is the stretch of facade that the front camera sees at once from the band's
middle; h_i is the band's upper edge, h_0 = 0 the ground; F_cur is the sum of all F_new. Then eq. 3 yields the upper
edge of the wanted floor, and its window lies half a floor below. The variant `camera_height` takes h_i for the
camera's height in band i and eq. 3's result for the final height, as a literal reader would.
"""

from itertools import pairwise
from typing import Literal, NamedTuple

_COUNT_TOLERANCE = 1e-6
"""Counts with fractions don't add up to whole floors exactly."""
_SAME_ROW_FLOORS = 0.3
"""Two window rows nearer than this share of a floor are one; real ones lie a whole floor apart."""
_HIDDEN_FLOORS = 1.25
"""A row of windows is about half a floor above its own floor; a tall ground floor's is not this far up."""
_STRETCHED = 1.5
"""Eq. 3's floors so many times as high as the rows stand apart are no floors."""
LEAST_FLOOR_M = 2.2
"""No floor that people live on is lower."""
TALLEST_FLOOR_M = 6.0
"""No building's floors are taller on average."""
_LEAST_ROWS_M = 1.8
"""Rows nearer to each other than this are not one wall's, even where it leans or steps back."""

Reading = Literal["upper_edge", "camera_height"]


class FloorLocalizationParameters(NamedTuple):
    """Free constants. `window_below_floors`: how far the window lies below its floor's upper edge, in floors.
    `min_height_m`: no height below this is flown to. `row_trust_floors`: how far eq. 3 may lie from the window row
    that was seen, in floors."""

    reading: Reading
    window_below_floors: float = 0.5
    min_height_m: float = 1.0
    row_trust_floors: float = 0.2


class Band(NamedTuple):
    """Band `number` (from 1) of the facade, from `lower_m` to `upper_m`, looked at from `camera_m`; above ground."""

    number: int
    lower_m: float
    upper_m: float
    camera_m: float


class VerticalView(NamedTuple):
    """What a level camera sees of an upright facade: so many metres above and below its own height per metre of
    stand-off (`Camera.up_slope`, `Camera.down_slope`)."""

    up_slope: float
    down_slope: float

    @property
    def camera_at(self) -> float:
        """How far up the seen stretch the camera stands, as a share of it."""
        return self.down_slope / (self.up_slope + self.down_slope)


class WindowRows(NamedTuple):
    """Where a picture shows its floors' windows: `rows`, 0..1 of the height from the top, topmost first, on a facade
    `stand_off_m` away, seen by a camera at `camera_m` above ground."""

    rows: tuple[float, ...]
    camera_m: float
    stand_off_m: float
    view: VerticalView

    def height_m(self, at: int) -> float:
        """Of row number `at`, above ground."""
        return row_height_m(self.rows[at], self.camera_m, self.stand_off_m, self.view)

    @property
    def spacing_m(self) -> float | None:
        """A floor's height by these rows; None where there are too few to tell."""
        if len(self.rows) < 2:
            return None
        return (self.height_m(0) - self.height_m(-1)) / (len(self.rows) - 1)

    @property
    def is_of_one_wall(self) -> bool:
        """Can they be floors above each other? A second wall's rows lie between those of the first."""
        heights = [self.height_m(at) for at in range(len(self.rows))]
        return all(upper - lower >= _LEAST_ROWS_M for upper, lower in pairwise(heights))


class Climb(NamedTuple):
    """Not there yet: on to this band; so many floors are counted below it."""

    band: Band
    floors_counted: float


class FinalHeight(NamedTuple):
    """h_final, by a floor height of `floor_height_m`; `floors_counted` is F_cur."""

    height_m: float
    floor_height_m: float
    floors_counted: float


class Recount(NamedTuple):
    """The band's count came back refused or unreadable: ask again from the same height, or give up."""

    band: Band
    floors_counted: float


class FloorNotFound(NamedTuple):
    """The facade ends below the wanted floor. `best_guess_m` is the topmost counted floor's window, None if no floor
    was counted at all."""

    floors_counted: float
    facade_top_m: float
    best_guess_m: float | None


Decision = Climb | FinalHeight | Recount | FloorNotFound


def band_span_m(stand_off_m: float, view: VerticalView) -> float:
    """Height of facade that the front camera sees at once: 2 d tan(VFoV / 2) where its principal point is in the
    middle. Raises ValueError for a stand-off or a view that spans nothing."""
    if not stand_off_m > 0.0 or not view.up_slope > 0.0 or not view.down_slope > 0.0:
        raise ValueError(f"no band at a stand-off of {stand_off_m} m and with {view}")
    return stand_off_m * (view.up_slope + view.down_slope)


def band(number: int, span_m: float, camera_at: float = 0.5) -> Band:
    """Band `number`, from 1 at the ground; bands touch and don't overlap. `camera_at`: how far up the band the camera
    stands that sees all of it and no more (`VerticalView.camera_at`)."""
    if number < 1:
        raise ValueError(f"bands count from 1, not {number}")
    return Band(number, (number - 1) * span_m, number * span_m, (number - 1 + camera_at) * span_m)


def decide(
    here: Band,
    floors_counted: float,
    floors_new: float | None,
    target_floor: int,
    facade_top_m: float | None,
    settings: FloorLocalizationParameters,
) -> Decision:
    """Eq. 3 after looking at band `here`.

    `floors_counted`: F_cur before this band. `floors_new`: F_new of this band, whole or with a fraction; None where
    there is no readable count. `facade_top_m`: the facade's measured upper edge above ground, None where it is not in
    sight; a roof inside the band takes the place of the band's upper edge, so that sky does not stretch the floors.
    With F_cur >= F_tar the height is final; F_new = 0 always climbs, since eq. 3 has no floor height then; and where
    the facade ends in or below this band without the wanted floor, there is no such floor.
    Raises ValueError for a floor below 1 or a negative count.
    """
    if target_floor < 1:
        raise ValueError(f"floors count from 1 at the ground, not {target_floor}")
    if floors_new is None:
        return Recount(here, floors_counted)
    if floors_new < 0 or floors_counted < 0:
        raise ValueError(f"floors can't be counted negative: {floors_counted} + {floors_new}")
    current = floors_counted + floors_new
    if facade_top_m is not None and facade_top_m <= here.lower_m and floors_new > 0:
        facade_top_m = None  # floors were seen where depth shows no wall: the count is what there is to go by
    upper = here.upper_m if facade_top_m is None else min(here.upper_m, facade_top_m)
    if floors_new > 0 and current >= target_floor - _COUNT_TOLERANCE:
        return FinalHeight(*_final(here, upper, current, floors_new, target_floor, settings), current)
    if facade_top_m is not None and facade_top_m <= here.upper_m:
        floor_height = facade_top_m / current if current > 0 else None
        guess = None if floor_height is None else facade_top_m - settings.window_below_floors * floor_height
        return FloorNotFound(current, facade_top_m, guess)
    span_m = here.upper_m - here.lower_m
    return Climb(band(here.number + 1, span_m, (here.camera_m - here.lower_m) / span_m), current)


def rows_of_band(here: WindowRows, below: WindowRows | None, of: Band) -> tuple[float, ...]:
    """The window rows that count for band `of`, topmost first: told apart from those of the band `below`, or in the
    first band carried down to the ground. A higher band's come back as they are where nothing was seen below."""
    if below is not None:
        return across_edge(here, below, of.lower_m)
    return down_to_ground(here) if of.number == 1 else here.rows


def across_edge(here: WindowRows, below: WindowRows, edge_m: float) -> tuple[float, ...]:
    """The window rows of a band, topmost first, told apart from those of the band below; `edge_m` is where they touch.

    A row of windows right on the edge is counted in both bands or in neither: a millimetre of the stand-off decides.
    Floors are equally high, so the rows on either side of the edge tell which. The same row seen twice is left out
    here; one that both missed is put in at the picture's lower edge. Otherwise, the rows come back as they are.
    """
    spacing_m = here.spacing_m or below.spacing_m
    if not here.rows or not below.rows or spacing_m is None or spacing_m <= 0.0:
        return here.rows
    upper_m, lower_m = here.height_m(-1), below.height_m(0)
    off_m = abs((upper_m + lower_m) / 2.0 - edge_m)
    gap_floors = (upper_m - lower_m) / spacing_m
    if off_m > _SAME_ROW_FLOORS * spacing_m:
        return here.rows
    if abs(gap_floors) <= _SAME_ROW_FLOORS:
        return here.rows[:-1]
    if abs(gap_floors - 2.0) <= _SAME_ROW_FLOORS:
        return (*here.rows, 1.0)
    return here.rows


def rows_above(here: WindowRows, edge_m: float) -> WindowRows:
    """Without the rows that lie clearly below a band's lower edge."""
    slack_m = _SAME_ROW_FLOORS * (here.spacing_m or 0.0)
    kept = tuple(row for at, row in enumerate(here.rows) if here.height_m(at) >= edge_m - slack_m)
    return here._replace(rows=kept)


def floors_seen_again(overlap_m: float, here: Band, floors_below: float) -> int:
    """How many floors a picture shows that were counted below band `here`, taken so much lower than the band wants:
    by the height of the floors below."""
    if floors_below <= 0.0 or here.lower_m <= 0.0 or overlap_m <= 0.0:
        return 0
    return round(min(overlap_m, here.lower_m) / (here.lower_m / floors_below))


def down_to_ground(lowest: WindowRows) -> tuple[float, ...]:
    """The window rows of the lowest band, topmost first, with those that something hides put in at the picture's lower
    edge: an eave, a canopy or a hedge hides the ground floor from a camera that looks down on it.

    Floors are equally high and the lowest one stands on the ground: where the lowest row seen is more than
    `_HIDDEN_FLOORS` floors up, the rows' own spacing tells how many lie beneath. Unchanged where the rows are too few.
    """
    spacing_m = lowest.spacing_m
    if spacing_m is None or spacing_m <= 0.0:
        return lowest.rows
    up_floors = lowest.height_m(-1) / spacing_m
    hidden = round(up_floors - 0.5) if up_floors > _HIDDEN_FLOORS else 0
    return (*lowest.rows, *(1.0,) * hidden)


def corrected(
    final: FinalHeight, target_floor: int, seen: WindowRows, settings: FloorLocalizationParameters
) -> FinalHeight:
    """Eq. 3's height held against the window row of the wanted floor, where the model says where it saw its floors.

    Eq. 3 stretches the floors over everything upright: a gable counts as a part of the topmost one. A window row that
    lies more than `row_trust_floors` of the rows' own spacing away from eq. 3's height is believed instead, unless it
    is a whole floor off: then the rows are no better, but where they begin at the ground and stand much closer than
    eq. 3's floors: then its band reaches into a sky that the sensor did not tell from wall. Unchanged where the rows
    are not the counted floors or too few to tell a floor's height from.
    """
    at = round(final.floors_counted) - target_floor  # rows begin at the topmost floor of this picture
    floor_height = seen.spacing_m
    if settings.reading != "upper_edge" or floor_height is None or not 0 <= at < len(seen.rows):
        return final
    height = seen.height_m(at)
    off = abs(height - final.height_m)
    if floor_height <= 0.0 or off <= settings.row_trust_floors * floor_height:
        return final
    stretched = final.floor_height_m > _STRETCHED * floor_height and 0.0 <= seen.height_m(-1) < floor_height
    stretched = stretched and floor_height >= LEAST_FLOOR_M
    if off >= final.floor_height_m and not stretched:
        return final
    return FinalHeight(max(settings.min_height_m, height), floor_height, final.floors_counted)


def _final(
    here: Band, upper_m: float, current: float, floors_new: float, target: int, settings: FloorLocalizationParameters
) -> tuple[float, float]:
    if settings.reading == "camera_height":
        # h_0 is the ground in both readings, so the first step is half a band here and a whole one after it
        below = 0.0 if here.number == 1 else here.camera_m - (here.upper_m - here.lower_m)
        floor_height = (here.camera_m - below) / floors_new
        height = here.camera_m - floor_height * (current - target)
    else:
        floor_height = (upper_m - here.lower_m) / floors_new
        height = upper_m - floor_height * (current - target) - settings.window_below_floors * floor_height
    return max(settings.min_height_m, height), floor_height


def direct_count(
    total_floors: float | None, building_height_m: float, target_floor: int, settings: FloorLocalizationParameters
) -> FinalHeight | FloorNotFound | None:
    """The `direct-count` ablation: all floors counted in one picture of the whole building, all equally high.

    None where there is no readable count.
    """
    if target_floor < 1 or not building_height_m > 0.0:
        raise ValueError(f"no floor {target_floor} in a building of {building_height_m} m")
    if total_floors is None:
        return None
    if total_floors <= 0:
        return FloorNotFound(0.0, building_height_m, None)
    floor_height = building_height_m / total_floors
    if target_floor > total_floors:
        guess = building_height_m - settings.window_below_floors * floor_height
        return FloorNotFound(total_floors, building_height_m, guess)
    height = (target_floor - settings.window_below_floors) * floor_height
    return FinalHeight(max(settings.min_height_m, height), floor_height, total_floors)


def row_height_m(row: float, camera_height_m: float, stand_off_m: float, view: VerticalView) -> float:
    """Height above ground of image row `row` (0..1 from the top) on an upright facade at `stand_off_m`."""
    return camera_height_m + stand_off_m * (view.up_slope - row * (view.up_slope + view.down_slope))
