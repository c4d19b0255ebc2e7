"""Parameters of the stages: each default that matters, with its range; a catalogue overrides them by stage and name."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

Share = Annotated[float, Field(ge=0, le=1)]
Degrees = Annotated[float, Field(gt=0, le=90)]
NonNegative = Annotated[float, Field(ge=0, le=1e6)]
Positive = Annotated[float, Field(ge=1e-6, le=1e6)]
Count = Annotated[int, Field(ge=1)]

FORMER_NAMES = {
    ("lights", "seed"): ("lights", "peak_level"),
    ("lights", "low"): ("lights", "edge_level"),
    ("lights", "high"): ("lights", "full_level"),
    ("lights", "second"): ("lights", "second_light_ratio"),
    ("lights", "odd"): ("lights", "area_ratio"),
    ("clusters", "share"): ("thresholds", "threshold"),
    ("clusters", "apart"): ("clusters", "separation"),
    ("clusters", "within"): ("clusters", "dwell"),
    ("depth", "confident"): ("depth", "use_confidence"),
    ("surface", "cut"): ("surface", "max_step"),
    ("surface", "steepest"): ("surface", "max_slope"),
}
"""Stage and name under which catalogues may still give a parameter, and its present stage and name."""


class StageParameters(BaseModel):
    """Parameters of one stage."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class SurveyParameters(StageParameters):
    """sample: frames read to find or check the spheres, and to find region and mask; margin: pixels around the mask;
    stabilize: whether frames of a shaken camera are moved back."""

    sample: Annotated[int, Field(ge=3, le=5000)] = 600
    margin: Annotated[int, Field(ge=2, le=500)] = 8
    stabilize: bool = True


class FramesParameters(StageParameters):
    """Frames are stored as they are."""


class LightsParameters(StageParameters):
    """peak_level, edge_level, full_level: levels of a highlight on the sphere between its background level (0) and
    saturation (1): of its brightest pixel, of its edge, and, above that, from which a pixel counts in full;
    second_light_ratio: area of a second light relative to the first; area_ratio: of a highlight to the usual area,
    beyond which it is ambiguous; tolerance: degrees between spheres; distance: of a near light in mm (two spheres
    measure it themselves)."""

    peak_level: Share = 0.6
    edge_level: Share = 0.25
    full_level: Share = 0.75
    second_light_ratio: Positive = 0.5
    area_ratio: Annotated[float, Field(gt=1)] = 3.0
    tolerance: Degrees = 5.0
    distance: Positive | None = None

    @model_validator(mode="after")
    def _rises_from_edge_to_full(self) -> Self:
        if self.edge_level >= self.full_level:
            raise PydanticCustomError(
                "levels",
                "edge_level {edge} must be below full_level {full}",
                {"edge": self.edge_level, "full": self.full_level},
            )
        return self


class MaskParameters(StageParameters):
    """A given mask is taken as it is; an estimated one has no parameters."""


class ThresholdsParameters(StageParameters):
    """threshold: share of the way from a pixel's background level to saturation from which the pixel is lit; None: by
    the density of the lights."""

    threshold: Share | None = None


class ClustersParameters(StageParameters):
    """clusters: kept per pixel; radius: of a light's disc in half vectors, degrees, None: by the light's size;
    separation: least distance of two clusters in radii; dwell: degrees within which a lingering light's frames share
    one vote; dark_frames: whether frames that leave a pixel dark tell where the disc's centre is."""

    clusters: Annotated[int, Field(ge=2, le=6)] = 3
    radius: Degrees | None = None
    separation: Positive = 1.6
    dwell: Degrees = 1.0
    dark_frames: bool = True


class MarkupParameters(StageParameters):
    """Marks are tracked from keyframe to keyframe."""


class SilhouetteParameters(StageParameters):
    """rim_weight: weight of the occluding contour in the smooth normal field; tension_length: in inradii."""

    rim_weight: Positive = 1.0
    tension_length: Positive = 0.12


class LabelsParameters(StageParameters):
    """The method and its weights.

    method: `sheets`, the literal `paper`, or `winner` takes all.
    edges, weight: of the paper's graph; the others belong to `sheets`.
    rounds: most iterations of labelling and smooth field.
    strength: cost in nats of labelling two identical neighbours differently.
    contrast: difference of unit normals at which that cost has fallen to 1/e.
    prior: share of the candidates that are exterior.
    shape_weight: factor of the log-likelihood ratios of the integrability and convexity prior.
    """

    method: Literal["sheets", "paper", "winner"] = "sheets"
    edges: Literal["layers", "surface"] = "layers"
    weight: Positive = 0.1
    rounds: Count = 10
    strength: NonNegative = 10.0
    contrast: Positive = 0.1
    prior: Annotated[float, Field(gt=0, lt=1)] = 0.5
    shape_weight: NonNegative = 1.0


class DepthParameters(StageParameters):
    """method, sharpness, rounds: of the integration; use_confidence: whether confidence weighs the normals."""

    method: Literal["bilateral", "least-squares"] = "bilateral"
    sharpness: Positive = 2.0
    rounds: Count = 30
    use_confidence: bool = True


class SurfaceParameters(StageParameters):
    """max_step, max_slope: in pixels, beyond which the mesh is torn between two pixels."""

    max_step: Positive = 1.0
    max_slope: Positive = 12.0


class ModelParameters(StageParameters):
    """passes: times that the views are merged, each labelled by the model of the pass before. Given for the catalogue
    or an object; a capture's own is ignored. most_triangles: the model is reduced to so many. base_plane: the height y,
    in the model's unit, of the plane on which the object stands on a turntable, or "found": from the silhouettes."""

    passes: Annotated[int, Field(ge=1, le=5)] = 3
    most_triangles: Annotated[int, Field(ge=100)] | None = None
    base_plane: Literal["found"] | Annotated[float, Field(ge=-1e6, le=1e6)] | None = None

    @field_validator("base_plane", mode="wrap")
    @classmethod
    def _as_one_fault(cls, value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        """Report one fault of a wrong value, not one for each kind of value that it might have been."""
        try:
            return handler(value)
        except ValidationError:
            raise PydanticCustomError(
                "found_or_height", "this is neither `found` nor a number from -1e6 to 1e6"
            ) from None


class Parameters(StageParameters):
    """Parameters of all stages, by stage."""

    survey: SurveyParameters = SurveyParameters()
    frames: FramesParameters = FramesParameters()
    lights: LightsParameters = LightsParameters()
    mask: MaskParameters = MaskParameters()
    thresholds: ThresholdsParameters = ThresholdsParameters()
    markup: MarkupParameters = MarkupParameters()
    silhouette: SilhouetteParameters = SilhouetteParameters()
    clusters: ClustersParameters = ClustersParameters()
    labels: LabelsParameters = LabelsParameters()
    depth: DepthParameters = DepthParameters()
    surface: SurfaceParameters = SurfaceParameters()
    model: ModelParameters = ModelParameters()

    @model_validator(mode="before")
    @classmethod
    def _with_current_names(cls, values: Any) -> Any:
        return with_current_names(values) if isinstance(values, Mapping) else values


def with_current_names(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return a catalogue's parameters, by stage, with former names replaced; a present name beside it wins."""
    renamed = {stage: dict(values) if isinstance(values, Mapping) else values for stage, values in parameters.items()}
    for (old_stage, old), (stage, name) in FORMER_NAMES.items():
        values = renamed.get(old_stage)
        if isinstance(values, dict) and old in values and isinstance(renamed.get(stage, {}), dict):
            value = values.pop(old)
            renamed.setdefault(stage, {}).setdefault(name, value)
            if not values:
                del renamed[old_stage]
    return renamed
