"""Errors that stages raise, for whoever runs them."""

from glint.tasks.algorithms.errors import UnusableCapture

__all__ = ["UnusableCapture"]
