"""Decode a video in one pass: by several threads while it is sound, by one thread whatever of it can be decoded.

What FFmpeg puts in place of what is damaged depends on the moments at which its threads meet. One thread gives the same
frames every time and everywhere.
"""

from collections.abc import Iterator
from typing import Any

import av

_MAX_DAMAGED_END = 64
"""Consecutive damaged frames that are held back, since they may be the end of a truncated file."""


class DamageMet(Exception):
    """Part of a video cannot be decoded as it was recorded."""


def sound_frames(container: Any) -> Iterator[av.VideoFrame]:
    """Yield frames in order, decoded by several threads.

    Raises:
        DamageMet: the next frame is damaged.
    """
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    # Without this, frames that refer to a damaged one and are shown before it would be yielded.
    stream.codec_context.options = {"err_detect": "explode"}
    try:
        for packet in container.demux(stream):
            for frame in stream.decode(packet):
                if frame.is_corrupt:
                    raise DamageMet
                yield frame
    except av.FFmpegError as error:
        raise DamageMet from error


def undamaged_frames(container: Any, warnings: list[str]) -> Iterator[av.VideoFrame]:
    """Yield frames in order; damaged ones, with a warning, only if an undamaged frame follows them."""
    damaged: list[av.VideoFrame] = []
    index, undecodable = 0, list[int]()
    for frame in decoded_frames(container, undecodable):
        if frame.is_corrupt and len(damaged) < _MAX_DAMAGED_END:
            damaged.append(frame)
        else:
            count = len(damaged) + int(frame.is_corrupt)
            if count:
                warnings.append(f"frames {index} to {index + count - 1} are damaged in the file")
            yield from damaged
            index += len(damaged) + 1
            damaged = []
            yield frame
    if damaged:
        warnings.append(f"the video is damaged from frame {index} on")
    if undecodable:
        warnings.append(
            f"{len(undecodable)} of its frames cannot be decoded and are left out, the first near {undecodable[0]}"
        )


def decoded_frames(container: Any, undecodable: list[int] | None = None) -> Iterator[av.VideoFrame]:
    """Yield the frames that can be decoded, by one thread.

    undecodable: for each packet that cannot be decoded, the number of frames before it is appended.
    """
    decoded = 0
    stream = container.streams.video[0]
    stream.codec_context.thread_count = 1
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
            if undecodable is not None:
                undecodable.append(decoded)
        if packet is None or (packet.dts is None and packet.size == 0):
            return
