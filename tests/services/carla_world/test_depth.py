"""CARLA's three bytes of depth, against a coder of the tests' own."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from contracts.images import DEPTH_METRES_PER_UNIT, decode_depth, encode_depth
from services.carla_world.depth import CODES, FAR_M, QUANTUM_M, decoded_depth
from tests.carla_double.streets import coded_depth

SHAPE = (5, 7)


@settings(deadline=None)
@given(arrays(np.float64, SHAPE, elements=st.floats(0.0, 999.9)))
def test_depth_is_exact_to_half_a_step_of_the_code(depth_m: np.ndarray) -> None:
    assert np.abs(decoded_depth(coded_depth(depth_m)) - depth_m).max() <= QUANTUM_M / 2 + 1e-9


@settings(deadline=None)
@given(arrays(np.uint32, SHAPE, elements=st.integers(0, CODES - 1)))
def test_every_code_is_the_formula_of_carlas_documents(codes: np.ndarray) -> None:
    red, green, blue = (codes >> shift & 255 for shift in (0, 8, 16))
    bgra = np.dstack([blue, green, red, np.full_like(red, 255)]).astype(np.uint8)
    expected = (red + green * 256.0 + blue * 256.0 * 256.0) / (256.0**3 - 1.0) * 1000.0
    assert np.array_equal(decoded_depth(bgra), expected) or np.allclose(decoded_depth(bgra), expected, rtol=1e-15)


def test_the_sky_is_no_return_and_what_is_just_before_it_is_not() -> None:
    sky = decoded_depth(coded_depth(np.array([[np.inf, FAR_M, FAR_M - 2 * QUANTUM_M]])))
    assert np.isinf(sky[0, :2]).all()
    assert np.isfinite(sky[0, 2])


@settings(deadline=None)
@given(arrays(np.float64, SHAPE, elements=st.floats(0.01, 131.0)))
def test_on_the_wire_it_is_exact_to_half_a_unit(depth_m: np.ndarray) -> None:
    sent = decode_depth(encode_depth(decoded_depth(coded_depth(depth_m))))
    assert np.abs(sent - depth_m).max() <= DEPTH_METRES_PER_UNIT / 2 + QUANTUM_M + 1e-5


def test_on_the_wire_the_sky_is_no_return() -> None:
    assert np.isinf(decode_depth(encode_depth(decoded_depth(coded_depth(np.full(SHAPE, np.inf)))))).all()
