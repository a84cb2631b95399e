"""A class of object for the simulator's catalogue: importing this module lists it."""

from services.sim.catalogue.palette import BRIGHT, Paint
from services.sim.catalogue.registry import STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box, ellipsoid


@catalogued(
    "toys",
    "surfboard",
    "surf board",
    "wave board",
    colours=BRIGHT,
    places=STANDING,
    size_m=(0.12, 0.44, 1.2),
)
def surfboard(paint: Paint) -> Mesh:
    """It stands on its tail, its deck to the front (+x)."""
    board = ellipsoid((0.05, 0.22, 0.6), (0.0, 0.0, 0.6), 16, 12, paint.main)
    stripe = box((0.02, 0.05, 0.9), (0.05, 0.0, 0.6), paint.accent)
    fin = box((0.07, 0.02, 0.12), (-0.025, 0.0, 0.12), paint.dark)
    return concatenate([board, stripe, fin])
