"""Cameras that stream by RTSP: a real server of somebody else's, H.264 over TCP, read as a drone's cameras are."""

import asyncio
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from contracts.images import decode_depth, decode_jpeg
from service_kit.errors import Unavailable
from services.mavlink_vehicle.cameras.filmed import FilmedCameras
from tests.conftest import free_port
from tests.services.mavlink_vehicle.test_cameras import HERE, opencv_file, written

pytestmark = pytest.mark.rtsp
HZ, SECONDS = 20, 120


class Streaming:
    """`rtsp-server` of aio-rtsp-toolkit, which publishes the films of a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._port, self._control = free_port(), free_port()
        self.process: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        return f"rtsp://127.0.0.1:{self._port}/front.mp4?play_count=0"

    def start(self) -> None:
        command = [str(Path(sys.executable).with_name("rtsp-server")), "--dir", str(self._folder)]
        ports = ["--host", "127.0.0.1", "--port", str(self._port), "--control-port", str(self._control)]
        self.process = subprocess.Popen([*command, *ports], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def streaming(tmp_path: Path) -> Iterator[Streaming]:
    films = tmp_path / "films"
    films.mkdir()
    film(films / "front.mp4")
    server = Streaming(films)
    server.start()
    yield server
    server.stop()


def film(path: Path) -> None:
    """Red to the left, black to the right."""
    import av

    picture = np.zeros((240, 320, 3), np.uint8)
    picture[:, :160, 0] = 250
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=Fraction(HZ), options={"tune": "zerolatency", "g": str(HZ)})
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        for _ in range(HZ * SECONDS):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


@pytest.fixture
def cameras_file(tmp_path: Path, streaming: Streaming) -> Path:
    opencv_file(tmp_path / "front.yaml", np.zeros(5))
    for number in range(HZ * SECONDS):
        assert cv2.imwrite(str(tmp_path / f"depth_{number:04d}.png"), np.full((240, 320), 2_500, np.uint16))
    text = f"""
[[cameras]]
name = "front"
source = "{streaming.address}"
calibration = "front.yaml"
[cameras.depth]
source = "{tmp_path}/depth_%04d.png"
"""
    return written(tmp_path / "cameras.toml", text)


async def until_well(cameras: FilmedCameras) -> None:
    async with asyncio.timeout(60):
        while True:
            if await cameras.problem() is None:
                return
            await asyncio.sleep(0.05)


async def test_a_camera_that_streams_by_rtsp_is_seen_goes_stale_with_its_server_and_comes_back(
    streaming: Streaming, cameras_file: Path
) -> None:
    cameras = FilmedCameras.load(cameras_file)
    cameras.start()
    try:
        await until_well(cameras)
        seen = await cameras.look(cameras.carried, lambda _: HERE, depth=True)
        rgb = decode_jpeg(seen.views[0].image)
        assert rgb.shape == (240, 320, 3)
        assert rgb[120, 40, 0] > 200 > 60 > rgb[120, 280, 0]
        assert seen.views[0].depth is not None
        assert decode_depth(seen.views[0].depth)[120, 160] == pytest.approx(2.5)
        first_s = seen.time_s
        await asyncio.sleep(0.5)
        assert (await cameras.look(cameras.carried, lambda _: HERE, depth=True)).time_s > first_s + 0.3
        streaming.stop()
        await asyncio.sleep(1.5)
        with pytest.raises(Unavailable, match="the last picture of camera front is") as stale:
            await cameras.look(cameras.carried, lambda _: HERE, depth=True)
        assert stale.value.code == "stale_frames"
        streaming.start()
        await until_well(cameras)
    finally:
        await cameras.close()
