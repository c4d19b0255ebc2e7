"""A video as footage: its luma plane, upright, full range."""

import contextlib
from collections.abc import Iterator
from typing import Any

import av
import cv2
import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.images import MAX_PIXELS
from glint.storage.footage.remote_file import RemoteFile
from glint.storage.locations.location import Location

_TURNS = {90: cv2.ROTATE_90_COUNTERCLOCKWISE, -90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, -180: cv2.ROTATE_180}
_HELD = 64
"""Damaged frames in a row that may turn out to be the end of a truncated file."""
MIN_KEYFRAMES = 8
"""Keyframes from which on they stand for the whole video."""
UNKNOWN_LENGTH_STEP = 64
"""Frames from one that is taken to the next in a video that does not say how many it has."""


class Video:
    """Footage of a video. `count` is what the file claims, 0 if it claims nothing; `warnings` fill while reading."""

    names: tuple[str, ...] = ()

    def __init__(self, location: Location) -> None:
        self.uri, self._location = location.uri, location
        self.warnings: list[str] = []
        with contextlib.ExitStack() as opened:
            container = opened.enter_context(self._open())
            first = next(self._decoded(container), None)
            if first is None:
                raise InputError(f"{self.uri} holds no frame that can be decoded", "film or copy it again")
            stream = container.streams.video[0]
            self.codec = stream.codec_context.name
            self.count = _claimed(container)
            frame = Luma(first)
        self.bits = frame.bits
        self.height, self.width = frame.shape

    def __enter__(self) -> "Video":
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Each pass over the frames opens the file for itself."""

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Luma (H, W) of frames start, start + step, ..; those between are decoded and dropped."""
        done, begin, end = 0, None, 0.0
        warnings: list[str] = []
        with self._open() as container:
            luma: Luma | None = None
            for frame in self._sound(container, warnings):
                if done >= start and (done - start) % step == 0:
                    luma = luma if luma and luma.fits(frame) else Luma(frame)
                    if luma.shape != (self.height, self.width):
                        raise InputError(
                            f"{self.uri} changes its size at frame {done}: {luma.shape[1]} x {luma.shape[0]}",
                            "cut the video there",
                        )
                    yield luma.of(frame)
                if frame.time is not None:
                    begin, end = frame.time if begin is None else begin, frame.time
                done += 1
            if _ends_early(container, done, end - (begin or 0.0)):
                of = f" of {self.count}" if self.count else ""
                warnings.append(f"the video ends early: frames 0 to {done - 1}{of} can be read")
        self.warnings = warnings

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` frames spread over the video, luma (H, W), the first one first.

        Keyframes are taken where there are enough of them, since they alone are decoded without those before them.
        """
        frames = self._keyframes(count)
        if len(frames) >= min(count, MIN_KEYFRAMES):
            return frames
        return list(self.frames(step=max(1, self.count // count) if self.count else UNKNOWN_LENGTH_STEP))

    def _keyframes(self, count: int) -> list[np.ndarray]:
        """Return the distinct keyframes at or before `count` moments spread evenly over the video."""
        frames: dict[int, np.ndarray] = {}
        with self._open() as container:
            stream = container.streams.video[0]
            duration = int(_seconds(container) / stream.time_base) if stream.time_base else 0
            try:
                for number in range(count if duration else 0):
                    container.seek((stream.start_time or 0) + duration * number // count, stream=stream)
                    frame = next(container.decode(stream), None)
                    if frame is None or frame.pts is None or frame.is_corrupt:
                        return []
                    if frame.pts not in frames:
                        frames[frame.pts] = Luma(frame).of(frame)
            except av.FFmpegError:
                return []
        same = [frame for frame in frames.values() if frame.shape == (self.height, self.width)]
        return same if len(same) == len(frames) else []

    def _sound(self, container: Any, warnings: list[str]) -> Iterator[av.VideoFrame]:
        """Frames in order; damaged ones are given out with a warning unless nothing sound follows them."""
        held: list[av.VideoFrame] = []
        index, lost = 0, list[int]()
        for frame in self._decoded(container, lost):
            if frame.is_corrupt and len(held) < _HELD:
                held.append(frame)
            else:
                if held:
                    warnings.append(f"frames {index} to {index + len(held) - 1} are damaged in the file")
                yield from held
                index += len(held) + 1
                held = []
                yield frame
        if held:
            warnings.append(f"the video is damaged from frame {index} on")
        if lost:
            warnings.append(f"{len(lost)} of its frames cannot be decoded and are left out, the first near {lost[0]}")

    def _decoded(self, container: Any, lost: list[int] | None = None) -> Iterator[av.VideoFrame]:
        """Frames that can be decoded; `lost` takes, for each packet that cannot, how many came before it."""
        decoded = 0
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets, None)
            except av.FFmpegError:
                packet = None
            try:
                for frame in stream.decode(packet):
                    decoded += 1
                    yield frame
            except av.FFmpegError:
                if packet is None:
                    return
                if lost is not None:
                    lost.append(decoded)
            if packet is None or (packet.dts is None and packet.size == 0):
                return

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        source: Any = self._location.path
        try:
            if self._location.local is None:
                source = RemoteFile(self._location)
            container = av.open(source)
        except FileNotFoundError as error:
            raise InputError(f"{self.uri} does not exist", "check the path") from error
        except (OSError, ValueError) as error:
            raise InputError(
                f"{self.uri} is no video that can be read ({getattr(error, 'strerror', None) or error})",
                "film or copy it again; a file whose copy was cut off has lost its index",
            ) from error
        with container:
            if not container.streams.video:
                raise InputError(f"{self.uri} has no video stream", "name a video or a folder of images")
            size = container.streams.video[0]
            if size.width * size.height > MAX_PIXELS:
                raise InputError(f"{self.uri} claims {size.width} x {size.height} pixels", "check the file")
            yield container


def _ends_early(container: Any, done: int, time: float) -> bool:
    """Whether less was read than the file claims: `done` frames, the last `time` seconds after the first."""
    stream = container.streams.video[0]
    # AVI counts slots, those too in which the camera had no frame.
    if stream.frames and container.format.name != "avi":
        return bool(stream.frames > done)
    interval = time / max(1, done - 1)
    # Without a duration of its own a stream is measured by the container's, which sound may lengthen.
    slack = 2 * interval if stream.duration else max(0.5, 3 * interval)
    return time + slack < _seconds(container)


def _seconds(container: Any) -> float:
    stream = container.streams.video[0]
    if stream.duration:
        return float(stream.duration * stream.time_base)
    return container.duration / av.time_base if container.duration else 0.0


def _claimed(container: Any) -> int:
    stream = container.streams.video[0]
    return int(stream.frames or _seconds(container) * float(stream.average_rate or 0))


class Luma:
    """How frames of one pixel format become upright full-range luma."""

    def __init__(self, frame: av.VideoFrame) -> None:
        self._format = (frame.format.name, frame.width, frame.height, frame.color_range, frame.rotation)
        depth = frame.format.components[0].bits
        self._wide = depth > 8
        self.bits = 16 if self._wide else 8
        self._turn = _TURNS.get(round(frame.rotation / 90) * 90)
        turned = self._turn in (cv2.ROTATE_90_CLOCKWISE, cv2.ROTATE_90_COUNTERCLOCKWISE)
        self.shape = (frame.width, frame.height) if turned else (frame.height, frame.width)
        self._planar = _has_luma_plane(frame.format)
        self._table = _full_range(depth, limited=_is_limited(frame)) if self._planar else None

    def fits(self, frame: av.VideoFrame) -> bool:
        """Whether a frame is laid out as the first one."""
        return self._format == (frame.format.name, frame.width, frame.height, frame.color_range, frame.rotation)

    def of(self, frame: av.VideoFrame) -> np.ndarray:
        """(H, W), a copy."""
        if self._planar:
            plane = frame.planes[0]
            kind = np.dtype("<u2") if self._wide else np.dtype(np.uint8)
            rows = np.frombuffer(plane, kind).reshape(-1, plane.line_size // kind.itemsize)
            luma = rows[: frame.height, : frame.width]
            if self._table is None:
                luma = luma.copy()
            else:
                luma = self._table[luma] if self._wide else cv2.LUT(luma, self._table)
        else:
            luma = cv2.cvtColor(frame.to_ndarray(format="bgr48le" if self._wide else "bgr24"), cv2.COLOR_BGR2GRAY)
        return luma if self._turn is None else cv2.rotate(luma, self._turn)


def _has_luma_plane(pixels: Any) -> bool:
    """Whether the first plane is luma, or grey, alone: yuv planes, nv12, gray; little endian."""
    name = pixels.name
    known = name.startswith(("yuv4", "yuvj4", "yuva4", "gray", "nv12", "nv21", "nv16", "nv24"))
    return known and not name.endswith("be") and not name.startswith(("yuyv", "grayf"))


def _is_limited(frame: av.VideoFrame) -> bool:
    """Video luma runs from 16 to 235 unless the file says otherwise; grey formats are full range."""
    name = frame.format.name
    if name.startswith(("yuvj", "gray")):
        return False
    return int(frame.color_range) != 2


def _full_range(depth: int, limited: bool) -> np.ndarray | None:
    """Table from the file's luma to 0..255 or 0..65535; None where nothing changes."""
    if not limited and depth in (8, 16):
        return None
    codes = np.arange(256 if depth == 8 else 65536, dtype=np.float64)
    unit = 2.0 ** (depth - 8)
    value = (codes - 16 * unit) / (219 * unit) if limited else codes / (2.0**depth - 1)
    top = 255 if depth == 8 else 65535
    return np.round(value.clip(0, 1) * top).astype(np.uint8 if depth == 8 else np.uint16)
