"""Threads of libraries: workers are as many as processors, so each library gets one thread."""

import cv2


def use_one_opencv_thread() -> None:
    """Make OpenCV use one thread in this process."""
    cv2.setNumThreads(1)
