"""One stream of pictures: a thread that reads it without a pause and keeps the latest frame and when it came."""

import threading
import time
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

OPEN_AGAIN_S = 1.0
OPEN_WITHIN_MS, READ_WITHIN_MS = 5_000, 2_000
CLOSES_WITHIN_S = 6.0
FILES_HZ = 20.0
Z16 = cv2.VideoWriter.fourcc("Z", "1", "6", " ")


class Frame(NamedTuple):
    """`time_s`: by the clock, when it was taken."""

    time_s: float
    image: NDArray[Any]


class Grabber:
    """`source`: a number or `/dev/video...` of this machine, an address such as `rtsp://...`, or a file; numbered
    pictures are `depth_%03d.png`. `raw`: the frames are depth, 16 bits a pixel, and stay as they are. `latency_s`: from
    the moment a frame is taken until it is read here."""

    def __init__(self, source: str, *, raw: bool, latency_s: float = 0.0) -> None:
        self.source = source
        self._raw = raw
        self._latency_s = latency_s
        self._latest: Frame | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {source}", daemon=True)
        self.trouble: str | None = None

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(CLOSES_WITHIN_S)

    @property
    def latest(self) -> Frame | None:
        return self._latest

    def _run(self) -> None:
        while not self._closing.is_set():
            capture = self._opened()
            if capture is not None:
                self._read(capture)
                capture.release()
            self._closing.wait(OPEN_AGAIN_S)

    def _opened(self) -> Any:
        source: int | str = int(self.source) if self.source.isdecimal() else self.source
        streamed = isinstance(source, str) and "://" in source
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_WITHIN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READ_WITHIN_MS]
        try:
            if streamed:
                capture = cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
            else:
                numbered = isinstance(source, str) and "%" in source
                capture = cv2.VideoCapture(source, cv2.CAP_IMAGES if numbered else cv2.CAP_ANY)
        except cv2.error as error:
            self.trouble = f"can't be opened: {str(error).splitlines()[0]}"
            return None
        if not capture.isOpened():
            self.trouble = "can't be opened"
            return None
        if self._raw:
            capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
            if isinstance(source, int) or str(source).startswith("/dev/"):
                capture.set(cv2.CAP_PROP_FOURCC, Z16)
        return capture

    def _read(self, capture: Any) -> None:
        """Until the stream ends, or gives what is no picture of its kind."""
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        filed = "://" not in self.source and not self.source.isdecimal() and not self.source.startswith("/dev/")
        # a file would give all at once
        pause_s = 1.0 / (rate_hz if 0.5 < rate_hz < 240.0 else FILES_HZ) if filed else 0.0
        while not self._closing.wait(pause_s):
            there, image = capture.read()
            if not there:
                self.trouble = "gives no more pictures"
                return
            fits = image.dtype == np.uint16 and image.ndim == 2 if self._raw else image.ndim == 3
            if not fits:
                kind = "depth, 16 bits a pixel" if self._raw else "a picture in colour"
                self.trouble = f"gives {image.dtype} {image.shape}, which is not {kind}"
                return
            self.trouble = None
            self._latest = Frame(time.monotonic() - self._latency_s, image)
