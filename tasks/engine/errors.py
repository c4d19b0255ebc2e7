"""Errors that stages raise, for whoever runs them."""

from glint.storage.errors import InputError
from glint.tasks.algorithms.errors import UnusableCapture, UnusableSphere

__all__ = ["SPHERE_ERRORS", "MisplacedSphere", "UnusableCapture"]


class MisplacedSphere(InputError):
    """A given sphere leaves the frame."""


SPHERE_ERRORS = (UnusableSphere, MisplacedSphere)
"""Errors of a capture whose spheres are missing or misplaced: other captures of its object may show where they are."""
