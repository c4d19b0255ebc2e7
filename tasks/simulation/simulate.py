"""Simulation: physically traced captures of transparent objects with their truth, written as a catalogue."""

import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture, Catalogue, Object, Pose, Sphere, load, write
from glint.storage.footage.writer import write_video
from glint.storage.replacement import replaced, restore_earlier
from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.multiview.view import rotation_about_y
from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.camera_poses import CameraPose, camera_poses
from glint.tasks.algorithms.simulation.environment import Environment
from glint.tasks.algorithms.simulation.light_path import light_path
from glint.tasks.algorithms.simulation.options import DEFAULT_PRESET, DEGRADED, PRESETS, SHAPES, CaptureOptions
from glint.tasks.algorithms.simulation.ray_tracing import Scene
from glint.tasks.algorithms.simulation.renderer import Renderer, camera_response, prepare_renderer
from glint.tasks.algorithms.simulation.solids import Solid
from glint.tasks.simulation.scene_layout import (
    FrameLayout,
    camera_distance,
    camera_of,
    frame_layout,
    mm_per_pixel,
    object_solids,
    region_centre,
    sphere_contour,
    sphere_solids,
    stood,
)
from glint.tasks.simulation.truth_files import (
    highlight_half_vectors,
    write_annotations,
    write_true_model,
    write_truth,
)

__all__ = ["DEGRADED", "PRESETS", "SHAPES", "CaptureOptions", "SimulationRecord", "simulate"]

FRAME_RATE = 25
"""Frames per second of the video."""
N_NOISE_PICTURES = 24
"""Pictures of noise that are drawn; each frame takes one of them, rolled."""
WALL_DISTANCE_PX = 40.0
"""Pixels from the object's back to the room's wall behind it."""
LIT_LEVEL = 225
"""8-bit level above which a pixel counts as lit."""


@dataclass(frozen=True, slots=True)
class SimulationRecord:
    """A simulation as written: the catalogue, the object's id, its captures' ids, and frames per capture."""

    catalogue: Path
    object_id: str
    captures: tuple[str, ...]
    frames: int


def simulate(
    shape: str, out: Path, options: CaptureOptions, progress: Callable[[int, int | None], None] | None = None
) -> SimulationRecord:
    """Write OUT/<shape>/<capture>/ and enter it in OUT/catalogue.yaml; an earlier object of this shape is replaced.

    The object appears whole or not at all: where it cannot be entered in the catalogue, the earlier one stays. The one
    that a killed simulation was replacing comes back first.
    progress(done, total): frames of all views together.

    Raises:
        ValueError: no such shape; OSError: the folder cannot be written.
    """
    if shape not in SHAPES:
        raise ValueError(f"no shape {shape!r}; there are {', '.join(SHAPES)}")
    out.mkdir(parents=True, exist_ok=True)
    restore_earlier(out / shape)
    preset = PRESETS.get(shape, DEFAULT_PRESET)
    frames = options.frames or preset.frames
    layout = frame_layout(round(preset.width * options.scale), round(preset.height * options.scale), options)
    captures = []
    with tempfile.TemporaryDirectory(dir=out, prefix=f".{shape}-") as temporary:
        for view, placement in enumerate(camera_poses(options)):
            name = "front" if options.views == 1 else f"view-{view:02d}"
            folder = Path(temporary) / shape / name
            folder.mkdir(parents=True)

            def report(done: int, before: int = view * frames) -> None:
                if progress is not None:
                    progress(before + done, frames * options.views)

            _write_view(shape, layout, options, frames, view, placement, folder, report)
            captures.append(_capture(out / shape / name, name, layout, options, placement))
        if options.views > 1:
            write_true_model(Path(temporary) / shape / "truth_model.ply", shape, layout, options)
        model = str((out / shape / "truth_model.ply").absolute()) if options.views > 1 else None
        with replaced(out / shape, Path(temporary) / shape):
            _enter(out / "catalogue.yaml", Object(id=shape, captures=tuple(captures), truth_model=model))
    return SimulationRecord(out / "catalogue.yaml", shape, tuple(capture.id for capture in captures), frames)


def _write_view(
    shape: str,
    layout: FrameLayout,
    options: CaptureOptions,
    frames: int,
    view: int,
    placement: CameraPose,
    folder: Path,
    report: Callable[[int], None],
) -> None:
    """Write the video, the truth, the annotations and the description of one view; report: called with frames done."""
    generator = np.random.default_rng([options.seed, view])
    columns, rows = np.meshgrid(np.arange(layout.width), np.arange(layout.height))
    x, y = to_camera(columns.astype(float), rows.astype(float), layout.width, layout.height)
    solids = object_solids(shape, layout, options, placement)
    spheres = sphere_solids(layout)
    distance = camera_distance(layout, options)
    # Along parallel rays a sphere can be moved to the table without another picture of it.
    is_lowered = options.shadows and distance is None
    table = _table([*solids, *spheres] if options.table_tilt and not is_lowered else solids, options)
    if is_lowered:
        spheres = [stood(solid, table, options.sphere_height * layout.radius) for solid in spheres]
    scene = Scene([*solids, *spheres])
    # Camera and object are static: the light paths are traced once, and each frame is a weighted sum over them.
    truth = scene.truth(x, y, distance)
    paths = scene.trace(x, y, options.rays, generator, distance)
    room = Environment.random(table, np.random.default_rng(options.seed), options.table_contrast)
    size, light_radius = (layout.height, layout.width), np.radians(options.light_radius)
    renderer = prepare_renderer(paths, room, size, light_radius, scene if options.shadows else None)
    lights = light_path(frames, generator, options.missing_quarter)
    if options.table_tilt or options.shadows:
        lights[lights @ table.normal <= 0.0] = np.nan
    lit_pixels = []

    def counted() -> Iterator[np.ndarray]:
        for number, picture in enumerate(_exposures(renderer, lights, layout, options, generator)):
            lit_pixels.append(int((picture[layout.region.rows, layout.region.columns] > LIT_LEVEL).sum()))
            yield picture
            report(number + 1)

    write_video(folder / "video.mp4", counted(), layout.width, layout.height, FRAME_RATE, options.crf)
    write_truth(folder, truth, lights, layout, options)
    highlight_vectors = highlight_half_vectors(truth, layout, options)
    write_annotations(folder / "markup.json", highlight_vectors, lights, np.array(lit_pixels), layout)
    description = {
        "shape": shape,
        "view": view,
        "turn": placement.turn,
        "rotation": placement.rotation.tolist(),
        **asdict(options),
    }
    (folder / "meta.json").write_text(json.dumps(description, indent=1) + "\n")


def _table(solids: Sequence[Solid], options: CaptureOptions) -> TablePlane:
    """Return the table's plane: what solids stand on if it is seen aslant, else some distance behind them."""
    tilt = np.radians(options.table_tilt)
    normal = np.array([0.0, np.sin(tilt), np.cos(tilt)])
    lowest = min(float((solid.vertices @ normal).min()) for solid in solids)
    return TablePlane(normal, lowest if options.table_tilt or options.shadows else lowest - WALL_DISTANCE_PX)


def _exposures(
    renderer: Renderer,
    lights: np.ndarray,
    layout: FrameLayout,
    options: CaptureOptions,
    generator: np.random.Generator,
) -> Iterator[np.ndarray]:
    """Yield the frames (height, width) uint8 under lights (T, 3): noise, drift of the exposure and shake applied."""
    frames = len(lights)
    light_distance = None if options.light_distance is None else options.light_distance * layout.width
    shape = (N_NOISE_PICTURES, layout.height, layout.width)
    noises = generator.normal(0.0, options.noise, shape).astype(np.float32)
    drift = 1.0 + options.exposure_drift * np.sin(np.linspace(0, 9.0, frames))
    shake = options.shake * np.cumsum(generator.normal(0, 0.1, (frames, 2)), axis=0) if options.shake else None
    for number in range(frames):
        noise = np.roll(noises[number % N_NOISE_PICTURES], int(generator.integers(0, layout.height)), axis=0)
        shift = (0.0, 0.0) if shake is None else (float(shake[number, 0]), float(shake[number, 1]))
        yield camera_response(renderer.render(lights[number], light_distance), noise, float(drift[number]), shift)


def _capture(folder: Path, name: str, layout: FrameLayout, options: CaptureOptions, placement: CameraPose) -> Capture:
    """Return the catalogue's entry of a view whose files are in a folder."""
    camera = camera_of(layout, options)
    spheres = [
        Sphere(x=x, y=y, radius=radius, diameter_mm=options.sphere_diameter)
        for x, y, radius in (sphere_contour(column, layout, camera) for column in layout.sphere_columns)
    ]
    return Capture(
        id=name,
        frames=str((folder / "video.mp4").absolute()),
        spheres=tuple(spheres),
        region=layout.region,
        mask=str((folder / "mask.png").absolute()),
        camera=camera,
        pose=None if options.views == 1 else _pose(layout, options, placement),
        truth=str((folder / "truth").absolute()),
    )


def _pose(layout: FrameLayout, options: CaptureOptions, placement: CameraPose) -> Pose:
    """Return the pose as a user would give it: the turntable's angle, or the camera's matrix in millimetres."""
    if not options.free_poses:
        return Pose(turntable=placement.nominal_angle)
    rotation = placement.rotation @ rotation_about_y(placement.nominal_angle)
    # The camera frame's origin is in the optical centre, or in the plane of the axis if there is none.
    distance = camera_distance(layout, options) or 0.0
    axis = np.array([region_centre(layout)[0] + placement.offset, 0.0, -distance])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ axis * mm_per_pixel(layout, options)
    rows = [tuple(float(value) for value in row) for row in matrix]
    return Pose.model_validate({"camera_to_world": rows})


def _enter(path: Path, entry: Object) -> None:
    """Add an object to the catalogue, or replace the one that has its id."""
    kept = [existing for existing in load(path).objects if existing.id != entry.id] if path.exists() else []
    name = path.parent.name or "simulated"
    write(Catalogue.model_validate({"schema": 1, "name": name, "objects": (*kept, entry)}), path)
