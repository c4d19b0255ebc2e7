"""Parameters of the steps: every default that matters, with its range; a catalogue overrides them by stage and name."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Share = Annotated[float, Field(ge=0, le=1)]
Degrees = Annotated[float, Field(gt=0, le=90)]
NonNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]


class _Stage(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Survey(_Stage):
    """sample: frames looked at where sphere or region must be found; margin: pixels around the mask."""

    sample: Annotated[int, Field(ge=3, le=5000)] = 600
    margin: Annotated[int, Field(ge=2, le=500)] = 8


class Frames(_Stage):
    """Frames are stored as they are."""


class Lights(_Stage):
    """seed, low, high: levels of a highlight on the sphere between its static level (0) and white (1); second: area
    of a second light relative to the first; odd: ratio of areas that is ambiguous; tolerance: degrees between spheres;
    distance: of a near lamp in mm (two spheres measure it themselves).
    """

    seed: Share = 0.6
    low: Share = 0.25
    high: Share = 0.75
    second: Positive = 0.5
    odd: Annotated[float, Field(gt=1)] = 3.0
    tolerance: Degrees = 5.0
    distance: Positive | None = None


class Mask(_Stage):
    """A given mask is taken as it is; an estimated one has no parameters."""


class Clusters(_Stage):
    """clusters: kept per pixel; radius: of a lamp's disc in half vectors, degrees; apart: least distance of two
    clusters in radii; share: how far a highlight rises from the pixel's static level to white; within: degrees over
    which lingering lights share one vote."""

    clusters: Annotated[int, Field(ge=2, le=6)] = 3
    radius: Degrees = 2.2
    apart: Positive = 1.6
    share: Share = 0.85
    within: Degrees = 1.0


class Markup(_Stage):
    """Marks are tracked from keyframe to keyframe."""


class Silhouette(_Stage):
    """rim_weight: pull of a rim pixel on the smooth field; tension_length: in inradii, see `field`."""

    rim_weight: Positive = 1.0
    tension_length: Positive = 0.12


class Labels(_Stage):
    """method: `sheets`, the literal `paper`, or `winner` takes all (for opaque shiny objects); edges, weight: of the
    paper's graph; the others belong to `sheets`."""

    method: Literal["sheets", "paper", "winner"] = "sheets"
    edges: Literal["layers", "surface"] = "layers"
    weight: Positive = 0.1
    rounds: Count = 10
    strength: NonNegative = 10.0
    contrast: Positive = 0.1
    prior: Annotated[float, Field(gt=0, lt=1)] = 0.5
    shape_weight: NonNegative = 1.0


class Depth(_Stage):
    """method, sharpness: see `integration`; confident: whether confidence weighs the normals."""

    method: Literal["bilateral", "least-squares"] = "bilateral"
    sharpness: Positive = 5.25
    rounds: Count = 9
    confident: bool = True


class Surface(_Stage):
    """cut, steepest: where the mesh is torn, see `surface`."""

    cut: Positive = 1.0
    steepest: Positive = 12.0


class Model(_Stage):
    """passes: times that the views are merged, each labelled by the model of the one before. Given for the catalogue
    or an object; a capture's own is not heeded. most_triangles: the model is reduced to so many."""

    passes: Annotated[int, Field(ge=1, le=5)] = 2
    most_triangles: Annotated[int, Field(ge=100)] | None = None


class Parameters(_Stage):
    """Parameters of all stages, by stage."""

    survey: Survey = Survey()
    frames: Frames = Frames()
    lights: Lights = Lights()
    mask: Mask = Mask()
    clusters: Clusters = Clusters()
    markup: Markup = Markup()
    silhouette: Silhouette = Silhouette()
    labels: Labels = Labels()
    depth: Depth = Depth()
    surface: Surface = Surface()
    model: Model = Model()
