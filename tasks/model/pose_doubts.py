"""Doubts about the poses of a model's views: what their normals say of them, and what they cost."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import simplify, with_confidence
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_alternatives import alternative_poses
from glint.tasks.algorithms.registration.pose_evidence import MAX_HELD_VIEWS, pose_evidence
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.view_agreement import (
    AGREEING_DEG,
    MAX_CONTRADICTING_SHARE,
    ViewAgreement,
    view_agreement,
)
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.model.corrections import corrected_views

MIN_COMPARED_SHARE = 0.05
"""Vertices that two views show with confidence, as a share of the model's, below which few views are hardly compared:
17% and more are with eight views, 12% with five."""
UNCOMPARED_TRUST = 0.9
"""Factor of the confidence where no two views can be compared and nothing else shows that their poses are right."""
CONTRADICTED_TRUST = 0.3
"""Factor of the confidence where other poses explain the normals better, or too many views had to be corrected."""


@dataclass(frozen=True, slots=True)
class PoseDoubts:
    """What the normals of V views say of their poses.

    agreement: how they agree; trust: (V,) the factors of the views' confidence; warnings: of those that contradict.
    """

    agreement: ViewAgreement
    trust: np.ndarray
    warnings: tuple[StageWarning, ...]


def pose_doubts(registered: RegisteredViews, model: Model) -> PoseDoubts:
    """Compare the normals of the registered views, as their own labels have them, where two of them see the model.

    Silhouettes of an object that looks alike from opposite sides agree after corrections of many scales and angles even
    where two views have each other's angles, and so do the few normals that views far apart share.
    """
    doubts, corrected = _doubts_of_normals(registered, model), corrected_views(registered)
    count = len(registered.views)
    if len(corrected) <= MAX_CONTRADICTING_SHARE * count:
        return doubts
    warning = StageWarning(
        f"the scales or angles of {len(corrected)} of the {count} views had to be corrected to agree with the"
        " silhouettes, too many to know which are right, so that nothing of the model is confident: check whether all"
        " videos have their own angles, and whether the camera was moved or zoomed between the views",
        "views",
    )
    trust = np.minimum(doubts.trust, CONTRADICTED_TRUST)
    return replace(doubts, trust=trust, warnings=(*doubts.warnings, warning))


def doubted_model(
    model: Model, views: Sequence[View], registered: RegisteredViews, max_triangles: int | None
) -> tuple[Model, PoseDoubts]:
    """Return a model with the confidence that its views deserve, and the doubts about their poses.

    Views are compared at the vertices of the whole model: a reduced one has too few that two of them see.

    views: the registered ones, perhaps with labels that derive from a model; max_triangles: to which the model is
    reduced, None: it stays as it is.
    """
    doubts = pose_doubts(registered, model)
    if max_triangles is not None:
        model = simplify(model, views, max_triangles)
    return with_doubts(model, views, registered.views, doubts), doubts


def _doubts_of_normals(registered: RegisteredViews, model: Model) -> PoseDoubts:
    """Return what the normals of the registered views say of their poses."""
    agreement = view_agreement(registered.views, model)
    is_weak = agreement.shared.sum() / 2 < MIN_COMPARED_SHARE * len(model.vertices)
    if not agreement.is_known or (is_weak and len(registered.views) <= MAX_HELD_VIEWS):
        return _without_comparison(registered, agreement)
    contradicting = agreement.contradicting()
    if len(contradicting) == len(registered.views):
        return PoseDoubts(agreement, agreement.trust(), (_warning_of_all(registered, agreement),))
    shares = agreement.shares(range(len(registered.views)))
    warnings = [
        StageWarning(
            f"the normals of {registered.views[number].name} contradict the other views': {shares[number]:.0%} of those"
            f" that another view shows as well agree to {AGREEING_DEG:g} degrees: check its pose, and whether its"
            " spheres and lights are right",
            "views",
        )
        for number in contradicting
    ]
    return PoseDoubts(agreement, agreement.trust(), tuple(warnings))


def with_doubts(model: Model, views: Sequence[View], own: Sequence[View], doubts: PoseDoubts) -> Model:
    """Return a model with the confidence that its views deserve.

    own: the same views as their own labels have them, which do not derive from a model as those of `views` may.
    """
    doubted, independent = (
        [replace(view, trust=view.trust * trust) for view, trust in zip(labelled, doubts.trust, strict=True)]
        for labelled in (views, own)
    )
    return with_confidence(doubted, model.vertices, model.triangles, model.cell, independent)


def _without_comparison(registered: RegisteredViews, agreement: ViewAgreement) -> PoseDoubts:
    """Return the doubts of views of which hardly two can be compared: each is held against a model of all others."""
    evidence = pose_evidence(registered.views, registered.turntable)
    count = len(registered.views)
    if evidence.is_sufficient:
        return PoseDoubts(agreement, np.ones(count), ())
    message = f"hardly two of the {count} views show the same part of the object with confidence, so that"
    if evidence.better_alternative is not None:
        message = (
            f"the normals of the views contradict their poses: {message} each was held against a model of the others,"
            f" and they agree better if {evidence.better_alternative}"
        )
        return PoseDoubts(agreement, np.full(count, CONTRADICTED_TRUST), (StageWarning(message, "views"),))
    message += (
        " nothing confirms their poses, nor the direction of a turntable: take more views in between, eight are good"
    )
    return PoseDoubts(agreement, np.full(count, UNCOMPARED_TRUST), (StageWarning(message, "views"),))


def _warning_of_all(registered: RegisteredViews, agreement: ViewAgreement) -> StageWarning:
    table, views = registered.turntable, registered.views
    is_alike = table is None or len(table.angles) == len(views)
    alternative = alternative_poses(views, table) if is_alike else None
    remedy = "check all poses (angles and their direction, or the axes of the matrices), and that all views show the"
    remedy = f"{remedy} same object" if alternative is None else f"all agree if {alternative}"
    return StageWarning(
        f"the normals of the views contradict their poses: where two views show the same point, {agreement.share:.0%}"
        f" agree to {AGREEING_DEG:g} degrees, and the model is wrong though the silhouettes agree: {remedy}",
        "views",
    )
