"""Questions about a stored capture: the sheets to ask about, the highlights that show them, answers as annotations."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.candidates.shading import without_shading
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import rotate_from_view, rotate_to_view
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.answers import mark_influence
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.results import Reconstruction
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.algorithms.questions.highlights import choose_highlight
from glint.tasks.algorithms.questions.proposals import ANSWERED_INFLUENCE, Question, propose
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.questions.capture_frames import CaptureFrames
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import disc_deg, faced
from glint.tasks.stages.labels import has_readmission, labelling_options, load_view, reconstruct
from glint.tasks.stages.markup import faced_marks, load_marks


@dataclass(frozen=True, slots=True)
class ShownQuestion:
    """A question, and the highlight that shows it: frame, x and y in pixels of the full frame."""

    question: Question
    frame: int
    x: int
    y: int

    def answer(self, is_true: bool) -> AnnotationEntry:
        """Return the answer as an annotation, as `markup` has them."""
        return AnnotationEntry(frame=self.frame, x=float(self.x), y=float(self.y), kind="true" if is_true else "false")


class CaptureQuestions:
    """The sheets of a capture whose stages up to `labels` are stored, labelled again with each set of annotations."""

    def __init__(self, work: CaptureContext) -> None:
        """Load what the labelling reads.

        Raises:
            StoreError: the capture was not run.
        """
        self.work, self.geometry = work, load_geometry(work)
        self._view = load_view(work)
        self.mask, self.clusters = self._view.mask, self._view.clusters
        self.frames = CaptureFrames(work, self.geometry, self.mask)
        self._explained: Alternation | None = None

    @cached_property
    def candidate_pixels(self) -> np.ndarray:
        """Pixels (H, W) bool of the object that have a candidate."""
        return np.asarray(np.isfinite(self.clusters.normals[..., 0]).any(axis=0) & self.mask)

    def frame_position(self, row: int, column: int) -> tuple[int, int]:
        """Return x and y in the full frame of a pixel of the region."""
        return column + self.geometry.region.x, row + self.geometry.region.y

    def sheet_of(self, layer: int, row: int, column: int) -> Question:
        """Return the sheet of a candidate as far as an answer to it reaches."""
        nodes, ties = self._sheets
        pins = np.zeros(nodes.shape, np.int8)
        pins[layer, row, column] = 1
        reached = mark_influence(nodes, ties, pins, inradius_of(self.mask)) > ANSWERED_INFLUENCE
        layers, rows, columns = np.nonzero(reached)
        is_exterior = bool(self._labels[layer, row, column] > 0)
        return Question(layers, rows, columns, is_exterior, wrong=0.0, change=0.0)

    def label(self, marks: Marks | None) -> Reconstruction:
        """Label the candidates with these marks."""
        parameters = self.work.parameters
        marked, readmission = replace(self._view, marks=marks), has_readmission(self.work.capture.pose)
        return reconstruct(marked, parameters.labels, parameters.silhouette, readmission=readmission)

    def stored_labels(self, marks: Marks | None) -> Reconstruction | None:
        """Return the labelling of the last run if its marks were the same; None: label again."""
        saved, known = self.work.load("labels"), load_marks(self.work) or Marks.empty()
        if not _are_same(known, marks or Marks.empty()) or "evidence" not in saved.arrays:
            return None
        return Reconstruction(
            labels=saved.read("labels"),
            normals=saved.read("normals"),
            initial=self._view.initial,
            provenance=saved.read("provenance"),
            confidence=saved.read("evidence"),
            iterations=(),
        )

    def draft_normals(self, marks: Marks | None) -> np.ndarray:
        """Return normals (H, W, 3) with these marks, at once: of a coarser field, and without confidence.

        What explains the labels without marks is kept, and gone on from. Methods other than `sheets` take their time.
        """
        parameters, view = self.work.parameters, self.geometry.view_vectors
        if parameters.labels.method != "sheets":
            return self.label(marks).normals
        if self._explained is None:
            clusters, camera = faced(without_shading(self.clusters), view), self.geometry.region_camera
            self._explained = explain(settle(clusters, self.mask, self._options, camera=camera, is_draft=True))
        return rotate_from_view(conclude(self._explained, faced_marks(marks, view)).normals, view)

    def propose(self, result: Reconstruction, marks: Marks | None, count: int) -> list[ShownQuestion]:
        """Propose at most `count` questions that a frame shows, the most valuable first.

        result: the labelling with `marks`.
        """
        view, region = self.geometry.view_vectors, self.geometry.region
        candidates, known_marks = faced(without_shading(self.clusters), view), faced_marks(marks, view)
        result = replace(result, normals=rotate_to_view(result.normals, view))
        shown = []
        # Some sheets are seen in no frame whose highlight is bright enough: ask for more than are needed.
        for question in propose(candidates, self.mask, result, known_marks, 2 * count, self._options):
            place = self._highlight(question)
            if place is not None:
                frame, row, column = place
                shown.append(ShownQuestion(question, frame, column + region.x, row + region.y))
            if len(shown) == count:
                break
        return shown

    def frame_of(self, question: Question) -> int | None:
        """Return the frame that shows a question's sheet, None where no frame does."""
        place = self._highlight(question)
        return None if place is None else place[0]

    @property
    def _options(self) -> LabellingOptions:
        parameters = self.work.parameters
        return labelling_options(parameters.labels, parameters.silhouette, has_readmission(self.work.capture.pose))

    @cached_property
    def _labels(self) -> np.ndarray:
        return np.asarray(self.work.load("labels").read("labels"))

    @cached_property
    def _sheets(self) -> tuple[np.ndarray, sparse.csr_matrix]:
        return sheet_graph(np.where(self.mask[None, :, :, None], self.clusters.normals, np.nan).astype(np.float32))

    def _highlight(self, question: Question) -> tuple[int, int, int] | None:
        normals, radius_deg = self.clusters.normals, disc_deg(self.work)
        frames = self.frames
        return choose_highlight(question, normals, frames.thresholds, frames.levels, frames.half_vectors_of, radius_deg)


def _are_same(known: Marks, marks: Marks) -> bool:
    return (
        np.array_equal(known.pixels, marks.pixels)
        and np.array_equal(known.kind, marks.kind)
        and np.allclose(known.half_vectors, marks.half_vectors, atol=1e-5)
    )
