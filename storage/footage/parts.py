"""Divide the packets of H.264 and HEVC into parts that can be decoded each on its own: from one IDR picture to another.

An IDR picture makes the decoder forget all earlier ones. Whatever hints at more than that being shared (missing or
equal times, pictures that are shown before the IDR picture, edit lists, damage, parameters that change on the way) ends
the division.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

HELD_BYTES = 256 << 20
"""Bytes of frames that may be decoded before they are taken; a video with longer parts is not divided."""
_SLICES = {"h264": range(1, 6), "hevc": range(32)}
"""Types of units that hold a picture or a part of it."""
_IDR = {"h264": (5,), "hevc": (19, 20)}
"""Those of these types that hold IDR pictures."""
_PARAMETERS = {"h264": (7, 8), "hevc": (32, 33, 34)}
"""Types of units that hold the parameters of the pictures that follow."""
_CONFIGURATION_BYTES = {"h264": 7, "hevc": 23}
"""Least size of a configuration record (ISO/IEC 14496-15), which begins with its version, 1."""
_SIZE_PLACE = {"h264": 4, "hevc": 21}
"""Position of its byte whose two lowest bits give the length, less one, of the field with a unit's size before each
unit."""


@dataclass(frozen=True, slots=True)
class Part:
    """Packets from an IDR picture to the next one at which a part begins.

    start: number of its first frame; times: of its frames, in their order, in units of the stream's time base.
    """

    start: int
    packets: list[Any]
    times: list[int]


def is_divisible(stream: Any) -> bool:
    """Return whether `parts_of` knows the structure of a stream of packets."""
    codec, configuration = stream.codec_context.name, stream.codec_context.extradata or b""
    return codec in _SLICES and len(configuration) >= _CONFIGURATION_BYTES[codec] and configuration[0] == 1


def parts_of(packets: Iterable[Any], stream: Any, least: int, most: int) -> Iterator[Part]:
    """Yield parts of at least `least` frames, the last one excepted, until one has more than `most`.

    stream: a divisible one; packets: its own, in the order of the file.

    Raises:
        ValueError: here the packets cannot be divided; what was yielded before is sound.
    """
    reader = _UnitReader(stream)
    start, part, latest = 0, list[Any](), -(1 << 63)
    has_parameters: bool | None = None
    for packet in packets:
        if packet.size == 0:
            break
        if packet.pts is None or packet.is_corrupt or packet.is_discard or packet.has_sidedata("new_extradata"):
            raise ValueError("a packet without a time, damaged, left out, or with a new configuration")
        is_idr, sets = reader.read(packet)
        if has_parameters is None:
            has_parameters = sets
        if sets != (is_idr and has_parameters) or not (is_idr or part):
            raise ValueError("parameters change between IDR pictures, or the first picture is none")
        if is_idr and len(part) >= least:
            times = _times(part, latest)
            latest = times[-1]
            yield Part(start, part, times)
            start, part = start + len(part), []
        part.append(packet)
        if len(part) > most:
            raise ValueError("a part is too long")
    if part:
        yield Part(start, part, _times(part, latest))


def _times(packets: list[Any], latest: int) -> list[int]:
    """Return the times of a part's frames, sorted; `latest`: of the part before.

    Raises:
        ValueError: two are equal, or one is not after the part before or is before the part's first picture.
    """
    times = sorted(packet.pts for packet in packets)
    if len(set(times)) != len(times) or times[0] != packets[0].pts or times[0] <= latest:
        raise ValueError("times that do not follow the order of the parts")
    return times


class _UnitReader:
    """Reads the types of the units of a packet."""

    def __init__(self, stream: Any) -> None:
        codec, configuration = stream.codec_context.name, stream.codec_context.extradata
        self._size_bytes = (configuration[_SIZE_PLACE[codec]] & 3) + 1
        self._shift, self._mask = (0, 31) if codec == "h264" else (1, 63)
        self._slices, self._idr, self._parameters = _SLICES[codec], _IDR[codec], _PARAMETERS[codec]

    def read(self, packet: Any) -> tuple[bool, bool]:
        """Return whether a packet holds an IDR picture, and whether parameters stand before its picture.

        Raises:
            ValueError: it holds no picture.
        """
        data, place, has_parameters = memoryview(packet), 0, False
        while place + self._size_bytes < len(data):
            head = place + self._size_bytes
            kind = data[head] >> self._shift & self._mask
            if kind in self._slices:
                return kind in self._idr, has_parameters
            has_parameters |= kind in self._parameters
            place = head + int.from_bytes(data[place:head], "big")
        raise ValueError("a packet without a picture")
