"""Conversions of arrays from Glint's camera frame to those of OpenCV and ROS.

Camera frame: x right, y up, z towards the camera, in the capture's unit. OpenCV's camera frame: x right, y down, z
ahead, in the same unit. ROS's optical frame (REP 103): OpenCV's axes, in metres.
"""

import numpy as np

from glint.storage.export.axes import OPENCV_FROM_CAMERA, Frame, conversion

__all__ = ["OPENCV_FROM_CAMERA", "Frame", "conversion", "opencv_pose", "to_opencv", "to_ros_optical"]


def to_opencv(vectors: np.ndarray) -> np.ndarray:
    """Return points or directions (..., 3) of the camera frame in OpenCV's camera frame, in the same unit and dtype."""
    signs = np.diagonal(OPENCV_FROM_CAMERA)[:3]
    return vectors * signs.astype(vectors.dtype)


def to_ros_optical(points: np.ndarray, unit: str) -> np.ndarray:
    """Return points (..., 3) of the camera frame, in `unit`, in ROS's optical frame, in metres, of the same dtype.

    Directions, which have no unit, are the same as OpenCV's: use `to_opencv`.

    Raises:
        ValueError: the points are in pixels.
    """
    matrix = conversion("ros_optical", unit)
    return points * np.diagonal(matrix)[:3].astype(points.dtype)


def opencv_pose(camera_to_world: np.ndarray) -> np.ndarray:
    """Return the matrix (4, 4) from the world frame to OpenCV's camera frame: its extrinsic matrix.

    camera_to_world: (4, 4), a capture's `pose`. With R and t the result's rotation and translation (in the capture's
    unit), `cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, camera_matrix, None)` gives pixels of the full frame.
    """
    return OPENCV_FROM_CAMERA @ np.linalg.inv(camera_to_world)
