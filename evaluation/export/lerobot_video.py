"""The films of a LeRobot dataset: a camera's pictures of all episodes one after the other, a frame a step, as AV1."""

from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
from numpy.typing import NDArray

from service_kit.settings import tell_library

CODEC, PIXELS = "libsvtav1", "yuv420p"
OPTIONS = {"crf": "20", "preset": "8", "g": "2", "svtav1-params": "lp=1"}
"""A key frame every other frame, so that any of them is found at once; `crf` 20 keeps what is small and far away."""
VIDEO_MB = 200
"""A file is ended once it is larger."""


class Placed(NamedTuple):
    """Where an episode's frames are: the file's number, and seconds from and to in it."""

    file: int
    from_s: float
    to_s: float


class FilmWriter:
    """One camera's films in `folder`; `name` makes a file's name from its number."""

    def __init__(self, folder: Path, camera_key: str, name: str, width: int, height: int, fps: int) -> None:
        self._folder = folder
        self._key = camera_key
        self._name = name
        self._width, self._height, self._fps = width, height, fps
        self._file = -1
        self._frames = 0
        self._film: _Film | None = None
        tell_library("SVT_LOG", "1")  # the encoder tells of errors alone

    def add(self, frames: list[NDArray[np.uint8]]) -> Placed:
        """The frames of one episode, (H, W, 3) RGB each. Raises OSError, av.FFmpegError."""
        film = self._film
        if film is None or film.size > VIDEO_MB * 1024 * 1024:
            self.close()
            self._file += 1
            self._frames = 0
            path = self._folder / self._name.format(video_key=self._key, chunk_index=0, file_index=self._file)
            path.parent.mkdir(parents=True, exist_ok=True)
            film = self._film = _Film(path, self._width, self._height, self._fps)
        first = self._frames
        for frame in frames:
            film.write(frame, self._frames)
            self._frames += 1
        return Placed(self._file, first / self._fps, self._frames / self._fps)

    def close(self) -> None:
        if self._film is not None:
            self._film.close()
            self._film = None


class _Film:
    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        self.size = 0
        self._container = av.open(str(path), "w")
        stream = self._container.add_stream(CODEC, rate=fps, options=OPTIONS)
        assert isinstance(stream, av.VideoStream)
        self._stream = stream
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, PIXELS

    def write(self, rgb: NDArray[np.uint8], number: int) -> None:
        frame = av.VideoFrame.from_ndarray(rgb, format="rgb24")
        frame.pts = number
        self._mux(frame)

    def close(self) -> None:
        self._mux(None)
        self._container.close()

    def _mux(self, frame: av.VideoFrame | None) -> None:
        for packet in self._stream.encode(frame):
            self.size += packet.size
            self._container.mux(packet)
