"""Threads of libraries: workers are as many as processors, so each library gets one thread."""

import cv2
import zarr


def use_one_thread() -> None:
    """Make OpenCV, and zarr where it reads frames, use one thread in this process."""
    cv2.setNumThreads(1)
    zarr.config.set({"codec_pipeline.max_workers": 1})
