"""Point clouds as PCD v0.7 files (Point Cloud Library), which PCL, Open3D and ROS read.

Axes are those of optical frames (x right, y down, z ahead), as these programs expect; the unit is metres where the
scale is known, else pixels.
"""

from pathlib import Path

import numpy as np

from glint.storage.export.axes import OPTICAL_AXES
from glint.storage.export.point_cloud import PointCloud

FIELDS = ("x", "y", "z", "normal_x", "normal_y", "normal_z", "confidence")


def optical_cloud(cloud: PointCloud) -> PointCloud:
    """Return the cloud (camera frame) in ROS's optical frame, or in OpenCV's where the scale is unknown."""
    return cloud.in_frame("ros_optical" if cloud.unit == "mm" else "opencv")


def write_pcd(path: Path, cloud: PointCloud, open_value: str) -> None:
    """Write a binary PCD file with normals and the field `confidence`, float32.

    open_value: what a single view leaves open of each connected piece, for the header.

    Raises:
        OSError: the file cannot be written.
    """
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        f"# unit {cloud.unit}; {OPTICAL_AXES if cloud.frame != 'camera' else 'x right, y up, z towards the camera'}",
        f"# a single view leaves the {open_value} of each connected piece open: the merged model shows where they lie",
        "VERSION 0.7",
        f"FIELDS {' '.join(FIELDS)}",
        f"SIZE {' '.join('4' for _ in FIELDS)}",
        f"TYPE {' '.join('F' for _ in FIELDS)}",
        f"COUNT {' '.join('1' for _ in FIELDS)}",
        f"WIDTH {len(cloud)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(cloud)}",
        "DATA binary",
    ]
    values = np.hstack([cloud.points, cloud.normals, cloud.confidence[:, None]]).astype("<f4")
    path.write_bytes(("\n".join(header) + "\n").encode("ascii") + values.tobytes())
