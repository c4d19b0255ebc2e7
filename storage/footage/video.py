"""Read a video as footage: its luma plane, upright, full range."""

import contextlib
import os
from collections.abc import Callable, Iterator
from typing import Any

import av
import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.decoding import DamageMet, decoded_frames, sound_frames, undamaged_frames
from glint.storage.footage.images import MAX_PIXELS
from glint.storage.footage.luma import LumaConverter
from glint.storage.footage.parts import is_divisible
from glint.storage.footage.remote_file import RemoteFile
from glint.storage.footage.side_by_side import SideBySide
from glint.storage.locations.input_files import plain_kind
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import items_within_time, within_time

MIN_KEYFRAMES = 8
"""Least number of keyframes that stand for the whole video."""
UNKNOWN_LENGTH_STEP = 64
"""Frames from one that is taken to the next in a video that does not state how many it has."""
MAX_DECODERS = 4
"""Decoders of one video, each of which holds frames."""


_FORMATS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpegtsraw,mpeg,mpegvideo,m4v,mxf,asf,flv,ogg,h264,hevc,obu,av1,"
    "ivf,nut,gif,mjpeg,yuv4mpegpipe,dv"
)
"""FFmpeg's names of formats that hold a video themselves; playlists (hls, dash, concat, ..) would open other files."""


def check_video_head(location: Location) -> None:
    """Refuse a file whose head is not that of a video.

    Raises:
        InputError: missing, no video, or a stated size that is too large.
    """
    with _open(location):
        pass


class Video:
    """Footage of a video; see `Footage`. `warnings` are those of the last complete pass over the frames."""

    names: tuple[str, ...] = ()

    def __init__(self, location: Location) -> None:
        self.uri, self._location = location.uri, location
        self.warnings: list[str] = []
        luma = within_time(lambda step: self._read_head(), self.uri)
        self.bits = luma.bits
        self.height, self.width = luma.shape

    def __enter__(self) -> "Video":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: each pass over the frames opens and closes the file."""

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield luma (H, W) of frames start, start + step, ..; those between are decoded and dropped.

        Raises:
            InputError: the file cannot be read, gives nothing for a minute, or its frames change their size.
        """
        for luma in items_within_time(self._frames(start, step), self.uri):
            if luma is not None:
                yield luma

    def _read_head(self) -> LumaConverter:
        """Read codec and stated number of frames; return the converter of the first frame."""
        with _open(self._location) as container:
            first = next(decoded_frames(container), None)
            if first is None:
                raise InputError(f"{self.uri} holds no frame that can be decoded", "record or copy it again")
            self.codec = container.streams.video[0].codec_context.name
            self.count = _stated_count(container)
            return LumaConverter(first)

    def _frames(self, start: int, step: int) -> Iterator[np.ndarray | None]:
        """Yield what `frames` does, and None for the frames between, which take their time too."""
        done, first_time, last_time = 0, None, 0.0
        warnings: list[str] = []
        with _open(self._location) as container:
            for number, luma, time in self._numbered(container, start, step, warnings):
                yield luma
                done = number + 1
                if time is not None:
                    first_time, last_time = time if first_time is None else first_time, time
            if _is_truncated(container, done, last_time - (first_time or 0.0)):
                total = f" of {self.count}" if self.count else ""
                warnings.append(f"the video ends early: frames 0 to {done - 1}{total} can be read")
        self.warnings = warnings

    def _numbered(
        self, container: Any, start: int, step: int, warnings: list[str]
    ) -> Iterator[tuple[int, np.ndarray | None, float | None]]:
        """Yield number, luma (None: not wanted) and time of each frame; one that is only decoded again has no luma."""

        def is_wanted(number: int) -> bool:
            return number >= start and (number - start) % step == 0

        done, decoders = 0, min(MAX_DECODERS, os.cpu_count() or 1)
        if decoders > 1 and is_divisible(container.streams.video[0]):
            with contextlib.ExitStack() as stack:
                containers = [stack.enter_context(_open(self._location)) for _ in range(decoders)]
                side_by_side = SideBySide(containers, (self.height, self.width), self.bits)
                for decoded in side_by_side.frames(is_wanted):
                    yield done, *decoded
                    done += 1
            if side_by_side.is_complete:
                return
        try:
            with _open(self._location) as another:
                for number, luma, time in self._converted(sound_frames(another), is_wanted, done):
                    yield number, luma, time
                    done = max(done, number + 1)
                return
        except DamageMet:
            yield from self._converted(undamaged_frames(container, warnings), is_wanted, done)

    def _converted(
        self, frames: Iterator[av.VideoFrame], is_wanted: Callable[[int], bool], done: int
    ) -> Iterator[tuple[int, np.ndarray | None, float | None]]:
        """Yield number, luma and time of all frames of the video.

        luma is None for the first `done`, and for those that are not wanted.
        """
        converter: LumaConverter | None = None
        for number, frame in enumerate(frames):
            if number < done or not is_wanted(number):
                yield number, None, frame.time
                continue
            if converter is None or not converter.is_same_format(frame):
                converter = LumaConverter(frame)
            if converter.shape != (self.height, self.width):
                height, width = converter.shape
                message = f"{self.uri} changes its size at frame {number}: {width} x {height}"
                raise InputError(message, "cut the video there")
            yield number, converter.convert(frame), frame.time

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` frames spread over the video, luma (H, W), the first one first.

        Keyframes are taken where there are enough of them, since they alone are decoded without those before them.
        """
        frames = within_time(lambda progress: self._keyframes(count, progress), self.uri)
        if len(frames) >= min(count, MIN_KEYFRAMES):
            return frames
        return list(self.frames(step=max(1, self.count // count) if self.count else UNKNOWN_LENGTH_STEP))

    def _keyframes(self, count: int, progress: Callable[[], None]) -> list[np.ndarray]:
        """Return the distinct keyframes at or before `count` moments spread evenly over the video.

        progress: called after each of them.
        """
        frames: dict[int, np.ndarray] = {}
        with _open(self._location) as container:
            stream = container.streams.video[0]
            duration = int(_seconds(container) / stream.time_base) if stream.time_base else 0
            try:
                for number in range(count if duration else 0):
                    container.seek((stream.start_time or 0) + duration * number // count, stream=stream)
                    frame = next(container.decode(stream), None)
                    if frame is None or frame.pts is None or frame.is_corrupt:
                        return []
                    if frame.pts not in frames:
                        frames[frame.pts] = LumaConverter(frame).convert(frame)
                    progress()
            except av.FFmpegError:
                return []
        same_size = all(frame.shape == (self.height, self.width) for frame in frames.values())
        return list(frames.values()) if same_size else []


@contextlib.contextmanager
def _open(location: Location) -> Iterator[Any]:
    """Open a container whose first video stream can be decoded."""
    # FFmpeg would take the JPEGs in a ZIP file for a video.
    if plain_kind(location) == "an archive":
        raise InputError(f"{location.uri} is an archive", "unpack it, and give the video or the folder of images")
    try:
        source: Any = location.path if location.local is not None else RemoteFile(location)
        container = within_time(lambda step: av.open(source, options={"format_whitelist": _FORMATS}), location.uri)
    except FileNotFoundError as error:
        raise InputError(f"{location.uri} does not exist", "check the path") from error
    except av.ArgumentError as error:
        raise InputError(
            f"{location.uri} has a format that holds no video",
            "give a video (MP4, MKV, ..) or a folder of images",
        ) from error
    except (av.FFmpegError, OSError, ValueError) as error:
        if kind := plain_kind(location):
            raise InputError(f"{location.uri} is {kind}", "give a video or a folder of images") from error
        raise InputError(
            f"{location.uri} is no video that can be read ({getattr(error, 'strerror', None) or error})",
            "record or copy it again; a truncated copy has lost its index",
        ) from error
    with container:
        if not container.streams.video:
            raise InputError(f"{location.uri} has no video stream", "give a video or a folder of images")
        stream = container.streams.video[0]
        if stream.codec_context is None:
            raise InputError(f"{location.uri} does not say how its video is encoded", "record or copy it again")
        if stream.width * stream.height > MAX_PIXELS:
            raise InputError(f"{location.uri} states {stream.width} x {stream.height} pixels", "check the file")
        yield container


def _is_truncated(container: Any, done: int, time: float) -> bool:
    """Return whether fewer frames were read than the header states: `done`, the last `time` seconds after the first."""
    stream = container.streams.video[0]
    # AVI also counts slots in which the camera had no frame.
    if stream.frames and container.format.name != "avi":
        return bool(stream.frames > done)
    interval = time / max(1, done - 1)
    # A stream without a duration of its own is compared with the container's, which sound may lengthen.
    slack = 2 * interval if stream.duration else max(0.5, 3 * interval)
    return time + slack < _seconds(container)


def _seconds(container: Any) -> float:
    """Return the video's duration by the file's header."""
    stream = container.streams.video[0]
    if stream.duration:
        return float(stream.duration * stream.time_base)
    return container.duration / av.time_base if container.duration else 0.0


def _stated_count(container: Any) -> int:
    """Return the number of frames by the file's header, 0 if unknown."""
    stream = container.streams.video[0]
    return int(stream.frames or _seconds(container) * float(stream.average_rate or 0))
