"""Simulate: physical captures of transparent objects with their truth, written as a catalogue."""

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy import ndimage

from glint.storage.catalogue.loading import Camera, Capture, Catalogue, Object, Pose, Region, Sphere, load, write
from glint.storage.export.image_files import write_png
from glint.storage.footage.writer import write_video
from glint.tasks.algorithms.frames.keyframes import keyframes
from glint.tasks.algorithms.geometry.perspective import Cone, straight, views
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, to_camera
from glint.tasks.algorithms.multiview.view import turned
from glint.tasks.algorithms.simulation.camera_poses import ROOM, Placement, placements
from glint.tasks.algorithms.simulation.environment import Room
from glint.tasks.algorithms.simulation.light_path import sweep
from glint.tasks.algorithms.simulation.options import DEGRADED, OTHER, PRESETS, SHAPES, CaptureOptions
from glint.tasks.algorithms.simulation.ray_tracing import Scene, Truth
from glint.tasks.algorithms.simulation.renderer import expose, prepare
from glint.tasks.algorithms.simulation.shapes import MARGIN as EDGE
from glint.tasks.algorithms.simulation.shapes import build
from glint.tasks.algorithms.simulation.solids import CHROME, Solid, ball

__all__ = ["DEGRADED", "PRESETS", "SHAPES", "CaptureOptions", "SimulationRecord", "simulate"]

MARGIN = 16
"""Pixels round the object's region, and round the ball."""
FPS = 25
BLOCK = 16
"""Pixels: frames are whole blocks of the codec, which makes the encoder's choices repeatable."""
NOISES = 24
"""Pictures of noise that are drawn; each frame takes one of them, rolled."""


@dataclass(frozen=True, slots=True)
class SimulationRecord:
    """What was written: the catalogue, and the captures' ids."""

    catalogue: Path
    object_id: str
    captures: tuple[str, ...]
    frames: int


@dataclass(frozen=True, slots=True)
class Stage:
    """The frame: its size, the object's region, the ball in pixels, and the columns of all balls."""

    width: int
    height: int
    region: Region
    x: float
    y: float
    radius: float
    balls: tuple[float, ...]


def simulate(
    shape: str, out: Path, options: CaptureOptions, progress: Callable[[int, int | None], None] | None = None
) -> SimulationRecord:
    """Write OUT/<shape>/<capture>/ and enter it in OUT/catalogue.yaml; a shape that is there already is replaced.

    A capture appears whole or not at all. progress: frames done, of all views together.

    Raises:
        ValueError: no such shape; OSError: the folder cannot be written.
    """
    if shape not in SHAPES:
        raise ValueError(f"no shape {shape!r}; there are {', '.join(SHAPES)}")
    out.mkdir(parents=True, exist_ok=True)
    preset = PRESETS.get(shape, OTHER)
    frames = options.frames or preset.frames
    stage = _stage(round(preset.width * options.scale), round(preset.height * options.scale), options)
    captures = []
    with tempfile.TemporaryDirectory(dir=out, prefix=f".{shape}-") as temporary:
        for view, placed in enumerate(placements(options)):
            name = "front" if options.views == 1 else f"view-{view:02d}"
            folder = Path(temporary) / shape / name
            folder.mkdir(parents=True)

            def tell(done: int, before: int = view * frames) -> None:
                if progress is not None:
                    progress(before + done, frames * options.views)

            _write_view(shape, stage, options, frames, view, placed, folder, tell)
            captures.append(_capture(out / shape / name, name, stage, options, placed))
        if options.views > 1:
            _write_model(shape, stage, options, Path(temporary) / shape / "truth_model.ply")
        if (out / shape).exists():
            (out / shape).rename(Path(temporary) / "replaced")
        (Path(temporary) / shape).rename(out / shape)
    model = str((out / shape / "truth_model.ply").absolute()) if options.views > 1 else None
    _enter(out / "catalogue.yaml", Object(id=shape, captures=tuple(captures), truth_model=model))
    return SimulationRecord(out / "catalogue.yaml", shape, tuple(each.id for each in captures), frames)


def _stage(width: int, height: int, options: CaptureOptions) -> Stage:
    radius = options.ball_radius
    full_height = max(height + 2 * MARGIN, int(2 * radius) + 2 * MARGIN)
    full_height += -full_height % BLOCK
    left = MARGIN + (options.balls - 1) * (int(2 * radius) + MARGIN)
    full_width = left + width + 2 * MARGIN + int(2 * radius) + MARGIN
    full_width += -full_width % BLOCK
    top = (full_height - height) // 2
    x = float(left + width + MARGIN + radius + 0.37)
    return Stage(
        full_width,
        full_height,
        Region(x=left, y=top, width=width, height=height),
        x=x,
        y=float(full_height * 0.55 + 0.21),
        radius=radius,
        balls=(x,) if options.balls == 1 else (x, float(MARGIN + radius + 0.18)),
    )


def _write_view(
    shape: str,
    stage: Stage,
    options: CaptureOptions,
    frames: int,
    view: int,
    placed: Placement,
    folder: Path,
    tell: Callable[[int], None],
) -> None:
    generator = np.random.default_rng([options.seed, view])
    columns, rows = np.meshgrid(np.arange(stage.width), np.arange(stage.height))
    x, y = to_camera(columns.astype(float), rows.astype(float), stage.width, stage.height)
    sideways, row = _middle(stage)
    # The object is made about its own middle; the world's origin is on its axis, in the frame's middle row.
    place = placed.rotation @ np.array([0.0, row, 0.0]) + np.array([sideways + placed.offset, 0.0, 0.0])
    if options.focal is None:
        width, height = _room(stage, options)
        made = build(shape, width, height, placed.turn, level=options.views > 1)
        solids = [each.moved(placed.rotation, place) for each in made]
    else:
        solids = _fitted(shape, stage, options.focal * stage.width)
    behind = min(float(solid.vertices[:, 2].min()) for solid in solids)
    for column in stage.balls:
        at = [float(v) for v in to_camera(np.array(column), np.array(stage.y), stage.width, stage.height)]
        solids.append(ball(np.array([*at, 0.0]), stage.radius, CHROME))
    scene = Scene(solids)
    away = None if options.focal is None else options.focal * stage.width
    truth = scene.truth(x, y, away)
    paths = scene.trace(x, y, options.rays, generator, away)
    room = Room.furnished(behind - 40.0, np.random.default_rng(options.seed))
    renderer = prepare(paths, room, (stage.height, stage.width), np.radians(options.lamp_radius))
    lights = sweep(frames, generator, options.missing_quarter)
    distance = None if options.lamp_distance is None else options.lamp_distance * stage.width

    def exposed() -> Iterator[np.ndarray]:
        noises = generator.normal(0.0, options.noise, (NOISES, stage.height, stage.width)).astype(np.float32)
        drift = 1.0 + options.exposure_drift * np.sin(np.linspace(0, 9.0, frames))
        wander = options.shake * np.cumsum(generator.normal(0, 0.1, (frames, 2)), axis=0) if options.shake else None
        for number in range(frames):
            noise = np.roll(noises[number % NOISES], int(generator.integers(0, stage.height)), axis=0)
            shift = (0.0, 0.0) if wander is None else (float(wander[number, 0]), float(wander[number, 1]))
            yield expose(renderer.render(lights[number], distance), noise, float(drift[number]), shift)
            tell(number + 1)

    lit = _write_video(folder / "video.mp4", exposed(), stage, options.crf)
    _write_truth(folder, truth, lights, stage, options)
    _write_markup(folder / "markup.json", _glinting(truth, stage, options), lights, lit, stage)
    about = {"shape": shape, "view": view, "turn": placed.turn, "rotation": placed.rotation.tolist()} | asdict(options)
    (folder / "meta.json").write_text(json.dumps(about, indent=1) + "\n")


def _fitted(shape: str, stage: Stage, away: float) -> list[Solid]:
    """The solids of a shape so large, and at such a place, that a camera at z = `away` sees them fill the region."""
    width, height, place = float(stage.region.width), float(stage.region.height), np.array([*_middle(stage), 0.0])
    room = np.array([width, height]) - 2.0 * EDGE
    for _ in range(12):
        solids = [each.moved(np.eye(3), place) for each in build(shape, round(width), round(height))]
        points = np.concatenate([each.vertices for each in solids if not each.inner])
        seen = points[:, :2] * away / (away - points[:, 2:])
        low, high = seen.min(axis=0), seen.max(axis=0)
        place[:2] += np.array(_middle(stage)) - (low + high) / 2.0
        share = float((room / (high - low)).min())
        width, height = 2.0 * EDGE + (width - 2.0 * EDGE) * share, 2.0 * EDGE + (height - 2.0 * EDGE) * share
    return solids


def _write_video(path: Path, pictures: Iterator[np.ndarray], stage: Stage, crf: int) -> np.ndarray:
    """Encode as H.264; return the number of lit pixels (T,) of the region in each frame."""
    lit = []

    def counted() -> Iterator[np.ndarray]:
        for picture in pictures:
            lit.append(int((picture[stage.region.rows, stage.region.columns] > 225).sum()))
            yield picture

    write_video(path, counted(), stage.width, stage.height, FPS, crf)
    return np.array(lit)


def _write_truth(folder: Path, truth: Truth, lights: np.ndarray, stage: Stage, options: CaptureOptions) -> None:
    (folder / "truth").mkdir()
    normals, depth = (values[stage.region.rows, stage.region.columns] for values in (truth.normals, truth.depth))
    mask = np.isfinite(depth)
    np.save(folder / "truth" / "normals.npy", normals)
    # Under perspective zero is where a pixel covers one unit, the distance of the focal length from the camera.
    zero = np.float32(0.0 if options.focal is not None else np.nanmean(depth))
    np.save(folder / "truth" / "depth.npy", depth - zero)
    np.save(folder / "truth" / "lights.npy", lights)
    if options.mask_error > 0:
        mask = ndimage.binary_dilation(mask, iterations=options.mask_error)
    elif options.mask_error < 0:
        mask = ndimage.binary_erosion(mask, iterations=-options.mask_error)
    write_png(folder / "mask.png", mask)


def _glinting(truth: Truth, stage: Stage, options: CaptureOptions) -> np.ndarray:
    """Half vectors (H, W, 3) under which the outer surface glints in the region."""
    camera, normals = _camera(stage, options), truth.normals[stage.region.rows, stage.region.columns]
    if camera is None:
        return normals
    view = views(np.array(camera.matrix), normals.shape, stage.region.x, stage.region.y)
    return straight(normals, view)


def _write_markup(
    path: Path, glinting: np.ndarray, lights: np.ndarray, lit: np.ndarray, stage: Stage, each: int = 3
) -> None:
    """A careful user's marks on some keyframes: true highlights where the surface glints."""
    half_vectors = half_vectors_of(lights)
    half_vectors[~(lights[:, 2] > 0)] = np.nan
    marks = []
    rows, columns = stage.region.rows, stage.region.columns
    for frame in keyframes(half_vectors, lit):
        error = np.linalg.norm(np.nan_to_num(glinting, nan=9.0) - half_vectors[frame], axis=-1)
        for _ in range(each):
            row, column = np.unravel_index(int(error.argmin()), error.shape)
            if error[row, column] > np.radians(1.0):
                break
            marks.append(
                {"frame": frame, "x": float(column + columns.start), "y": float(row + rows.start), "kind": "true"}
            )
            error[max(0, row - 8) : row + 9, max(0, column - 8) : column + 9] = 9.0
    path.write_text(json.dumps(marks, indent=0) + "\n")


def _capture(folder: Path, name: str, stage: Stage, options: CaptureOptions, placed: Placement) -> Capture:
    camera = _camera(stage, options)
    balls = [
        Sphere(x=x, y=y, radius=radius, diameter_mm=options.ball_diameter)
        for x, y, radius in (_outline(column, stage, camera) for column in stage.balls)
    ]
    return Capture(
        id=name,
        frames=str((folder / "video.mp4").absolute()),
        spheres=tuple(balls),
        region=stage.region,
        mask=str((folder / "mask.png").absolute()),
        camera=camera,
        pose=None if options.views == 1 else _pose(stage, options, placed),
        truth=str((folder / "truth").absolute()),
    )


def _camera(stage: Stage, options: CaptureOptions) -> Camera | None:
    if options.focal is None:
        return None
    focal, x, y = options.focal * stage.width, (stage.width - 1) / 2, (stage.height - 1) / 2
    return Camera(matrix=((focal, 0.0, x), (0.0, focal, y), (0.0, 0.0, 1.0)))


def _outline(column: float, stage: Stage, camera: Camera | None) -> tuple[float, float, float]:
    """Centre and radius of a ball's outline as the catalogue gives them, in pixels; its centre is at z = 0."""
    if camera is None:
        return column, stage.y, stage.radius
    x, y = to_camera(np.array(column), np.array(stage.y), stage.width, stage.height)
    centre = np.array([float(x), float(y), -camera.matrix[0][0]])
    away = float(np.linalg.norm(centre))
    return Cone(centre / away, stage.radius / away).outline(np.array(camera.matrix))


def _pose(stage: Stage, options: CaptureOptions, placed: Placement) -> Pose:
    """As a user would give it: the turntable's angle, or the camera's matrix in millimetres."""
    if not options.free_poses:
        return Pose(turntable=placed.said)
    rotation = placed.rotation @ turned(placed.said)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ np.array([_middle(stage)[0] + placed.offset, 0.0, 0.0]) * _scale(stage, options)
    rows = [tuple(float(value) for value in row) for row in matrix]
    return Pose.model_validate({"camera_to_world": rows})


def _middle(stage: Stage) -> tuple[float, float]:
    """The region's middle in the camera frame."""
    column = np.array(stage.region.x + (stage.region.width - 1) / 2)
    x, y = to_camera(column, np.array(stage.region.y + (stage.region.height - 1) / 2), stage.width, stage.height)
    return float(x), float(y)


def _room(stage: Stage, options: CaptureOptions) -> tuple[int, int]:
    """Width and height that the object may fill."""
    share = ROOM if options.free_poses else 1.0
    return round(stage.region.width * share), round(stage.region.height * share)


def _scale(stage: Stage, options: CaptureOptions) -> float:
    """Millimetres of a pixel."""
    return options.ball_diameter / (2.0 * stage.radius)


def _write_model(shape: str, stage: Stage, options: CaptureOptions, path: Path) -> None:
    """The outer surface in world coordinates, millimetres: the turntable's axis is y, y = 0 the frame's middle row."""
    outer = [each for each in build(shape, *_room(stage, options), 0.0, level=True) if not each.inner]
    shift = np.array([0.0, _middle(stage)[1], 0.0])
    meshes = [
        trimesh.Trimesh((each.vertices + shift) * _scale(stage, options), each.triangles, process=False)
        for each in outer
    ]
    path.write_bytes(bytes(trimesh.util.concatenate(meshes).export(file_type="ply")))


def _enter(path: Path, entry: Object) -> None:
    """Put an object into the catalogue, or in the place of the one that has its id."""
    others = [each for each in load(path).objects if each.id != entry.id] if path.exists() else []
    name = path.parent.name or "simulated"
    write(Catalogue.model_validate({"schema": 1, "name": name, "objects": (*others, entry)}), path)
