"""The base plane of an object's model: found or given, and what the silhouettes say about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from glint.tasks.algorithms.multiview.base_plane import base_evidence
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.engine.stage_warning import StageWarning


@dataclass(frozen=True, slots=True)
class BasePlane:
    """The plane on which an object stands.

    height: its y in world units, None if it is not known or not used; record: its entry in model.json, None if there is
    none; warnings: why it is not used.
    """

    height: float | None = None
    record: dict[str, Any] | None = None
    warnings: tuple[StageWarning, ...] = ()


def base_plane(registered: RegisteredViews, option: Literal["found"] | float | None) -> BasePlane:
    """Return the base plane for the parameter `model.base_plane`: "found", its height y in world units, or None."""
    if option is None:
        return BasePlane()
    if registered.turntable is None:
        return _unused(option, "no view stands on a turntable, so what is up is not known")
    names: Sequence[str] = [view.name for view in registered.views]
    evidence = base_evidence(registered.views)
    height = evidence.height if option == "found" else float(option)
    contradiction = evidence.contradiction(height, names)
    bounds = {"highest_possible": evidence.height, "lowest_possible": evidence.lowest}
    if option != "found" and contradiction is not None:
        return _unused(option, contradiction, bounds)
    return BasePlane(height, {"height": height, "origin": "found" if option == "found" else "given", **bounds})


def _unused(option: str | float, reason: str, bounds: dict[str, float] | None = None) -> BasePlane:
    given = "that was to be found" if option == "found" else f"at y = {option:g}"
    message = f"the base plane {given} is not used: {reason}"
    record = {"height": None, "origin": "not used", "reason": reason, **(bounds or {})}
    return BasePlane(None, record, (StageWarning(message, "views"),))
