"""Frames of reference: the camera frame of Glint, and the conversions to those of OpenCV and ROS.

Camera frame (docs/method.md): x right, y up, z towards the camera. OpenCV's camera frame: x right, y down, z ahead.
ROS's optical frame (REP 103) has OpenCV's axes and counts in metres. World frame: right-handed, y up, z towards the
camera at turntable angle 0.
"""

from typing import Literal

import numpy as np

Frame = Literal["camera", "opencv", "ros_optical"]
"""Names of the frames of reference."""

METRES_PER_MM = 0.001

CAMERA_AXES = "x right, y up, z towards the camera"
OPTICAL_AXES = "x right, y down, z ahead of the camera"
WORLD_AXES = "right-handed, y up"

OPENCV_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
"""Converts homogeneous points (4,) of the camera frame to OpenCV's camera frame, in the same unit; its own inverse."""

OPENCV_FROM_CAMERA.flags.writeable = False


def conversion(frame: Frame, unit: str) -> np.ndarray:
    """Return the matrix (4, 4) float64 that converts homogeneous points of the camera frame, in `unit`, to `frame`.

    Directions (normals) are converted by the signs of its diagonal alone, since it may scale.

    Raises:
        ValueError: no such frame, or `ros_optical` for points in pixels, which cannot be given in metres.
    """
    if frame == "camera":
        return np.eye(4)
    if frame == "opencv":
        return OPENCV_FROM_CAMERA.copy()
    if frame != "ros_optical":
        raise ValueError(f"no frame of reference {frame!r}: use camera, opencv or ros_optical")
    if unit not in ("mm", "m"):
        raise ValueError(
            f"points in {unit} have no size in metres, as ROS's optical frame needs: use opencv, or give the capture a"
            " pixel_size or its sphere a diameter_mm and run it again"
        )
    scale = METRES_PER_MM if unit == "mm" else 1.0
    return OPENCV_FROM_CAMERA @ np.diag([scale, scale, scale, 1.0])


def converted_unit(frame: Frame, unit: str) -> str:
    """Return the unit of points after `conversion(frame, unit)`."""
    return "m" if frame == "ros_optical" else unit
