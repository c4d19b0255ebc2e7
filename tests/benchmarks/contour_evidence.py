"""Contour evidence: how well pictures tell occluding contours inside the silhouette of a shape that was not learned.

    python -m tests.benchmarks.contour_evidence [SHAPE ...] [--seed 102] [--folder DIR]

A logistic regression learns from four views each of elephant, teddy bear and bird (seed 101) whether a contour runs
beside a pixel, and to which side the surface falls: from levels along a line across it, from edges that stay in many
frames, and from how alike pixels on both sides change over time, with highlights and without. Scores are averaged
along curves, and the ridges above a limit are the contours. Of each view of SHAPE (puppy by default) it prints how many
of them lie within 1.5 px of a true one, how many pixels before true ones lie within 1.5 px of them, in brackets both by
chance, and the squared errors of the normals (observed pixels / whole mask) as they are, with a field cut there, and
with a field cut along their mirror image.
"""

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.simulation.simulate import CaptureOptions
from tests.benchmarks.inner_contours import TRUE_CONTOURS_ALONE, Contours, normals_with
from tests.benchmarks.overlapping_limbs import MIN_STEP_PX
from tests.benchmarks.picture_edges import INSIDE_PX, contour_pixels, sampled_frames
from tests.benchmarks.picture_edges import MIN_STEP_PX as LEAST_STEP_PX
from tests.benchmarks.simulated_captures import shapes_parser, simulated_captures
from tests.benchmarks.true_view import TrueView

LEARNED, LEARNED_SEED, LEARNED_VIEWS, TESTED_VIEWS = ("elephant", "teddy-bear", "bird"), 101, 4, 3
"""Shapes, seed and views that are learned from, and the views of each other shape."""
BINS = 16
"""Directions across a contour, from the near to the far side."""
OFFSETS_PX = (-5.0, -3.5, -2.0, -1.0, 0.0, 1.0, 2.0, 3.5, 5.0)
"""Places along the line across a contour."""
PAIRS_PX = ((-1, 2), (-2, 3), (-4, -1), (2, 5), (0, 1), (-3, -1), (2, 4))
"""Pairs of places that are compared over time; the contour lies between 0 and 1."""
COMPONENTS = 32
"""Principal components of the levels over time."""
BASE_QUANTILE, SATURATION = 0.85, 0.3
"""Quantile over time at which highlights are cut off, and the gradient of root levels that counts as an edge."""
NEAR_PX, BESIDE_PX, N_BESIDE, N_ELSEWHERE = 1.5, 6.0, 4000, 12000
"""Distances within which a pixel counts as on a contour and beside one; sampled pixels beside one and elsewhere."""
LIMITS, LINK_PX, MIN_LENGTH_PX = (0.35, 0.1), 3, 4
"""Scores from which there is a contour, the distance over which they are averaged, the least pixels of one."""
RIDGE = 3.0
"""Weight of the squared coefficients, of standardized features."""


class Pictures:
    """Pictures of a capture, from which the features of a contour are taken."""

    def __init__(self, frames: np.ndarray, thresholds: np.ndarray, mask: np.ndarray) -> None:
        """Summarize frames (T, H, W), with the levels (H, W) from which pixels are lit, and the mask (H, W) bool."""
        levels, lit = np.sqrt(frames), frames > thresholds
        base = np.minimum(levels, np.quantile(levels, BASE_QUANTILE, axis=0))
        low, median, high = np.quantile(levels, (0.1, 0.5, 0.9), axis=0)
        pictures = [low, median, high, levels.mean(axis=0), levels.max(axis=0), levels.std(axis=0)]
        pictures.append(np.sqrt(lit.mean(axis=0)))
        self.pictures = [(level - level[mask].mean()) / max(level[mask].std(), 1e-6) for level in pictures]
        self.edges = np.zeros((5, *mask.shape))
        for frame in base:
            down, right = np.gradient(ndimage.gaussian_filter(frame, 0.7))
            size = np.maximum(np.hypot(down, right), SATURATION)
            down, right = down / size, right / size
            self.edges += np.stack([right, down, right**2, right * down, down**2]) / len(base)
        flashes = ndimage.gaussian_filter(lit.astype(np.float32), (1.0, 0.7, 0.7))
        self.courses = [_components(values, mask) for values in (base, flashes)]

    def features(self, rows: np.ndarray, columns: np.ndarray, bins: np.ndarray | int) -> np.ndarray:
        """Return the features (n, F) of contours before pixels (n,), falling in the directions of bins (n,)."""
        down, right = _directions(bins)

        def at(picture: np.ndarray, across: float) -> np.ndarray:
            places = [[rows + across * down + s * right, columns + across * right - s * down] for s in (-1.5, 0, 1.5)]
            return np.mean([ndimage.map_coordinates(picture, p, order=1, mode="nearest") for p in places], axis=0)

        def course(values: np.ndarray, across: float, along: float) -> np.ndarray:
            places = rows + across * down + along * right, columns + across * right - along * down
            return values[
                tuple(np.rint(p).clip(0, n - 1).astype(int) for p, n in zip(places, values.shape, strict=False))
            ]

        result = []
        for picture in self.pictures:
            profile = [at(picture, offset + 0.5) for offset in OFFSETS_PX]
            middle = profile[len(profile) // 2]
            result += [middle, *(level - middle for level in profile if level is not middle)]
            result += [np.abs(profile[3] - profile[5]), np.abs(profile[2] - profile[6])]
        for offset in range(-2, 4):
            x, y, xx, xy, yy = (at(edge, offset) for edge in self.edges)
            result += [x * right + y * down, xx * right**2 + 2.0 * xy * right * down + yy * down**2]
            result.append(xx * down**2 - 2.0 * xy * right * down + yy * right**2)
        for values in self.courses:
            for first, second in PAIRS_PX:
                pairs = [course(values, first, s) * course(values, second, s) for s in (-2.0, 0.0, 2.0)]
                result.append(np.mean([pair.sum(axis=-1) for pair in pairs], axis=0))
            result += [(course(values, o, -2.0) * course(values, o, 2.0)).sum(axis=-1) for o in (0.0, 1.0)]
        return np.stack(result, axis=-1)


def _components(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return unit vectors (H, W, COMPONENTS) whose products are the correlations over time of values (T, H, W)."""
    series = values[:, mask] - values[:, mask].mean(axis=0)
    size = np.linalg.norm(series, axis=0)
    series = series / np.maximum(size, np.quantile(size, 0.05) + 1e-6)
    vectors = series.T @ np.linalg.eigh(series @ series.T)[1][:, ::-1][:, :COMPONENTS]
    result = np.zeros((*mask.shape, COMPONENTS))
    result[mask] = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-3)
    return result


def _directions(bins: np.ndarray | int) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps down and right of directions."""
    angle = np.asarray(bins) * 2.0 * np.pi / BINS
    return np.sin(angle), np.cos(angle)


class PicturedView:
    """The pictures of a view, and its true contours."""

    def __init__(self, view: TrueView) -> None:
        """Read the frames."""
        self.view = view
        self.inside = ndimage.binary_erosion(view.mask, iterations=INSIDE_PX)
        near, self.across = contour_pixels(view.depth, MIN_STEP_PX)
        self.near, self.any = near & self.inside, near | contour_pixels(view.depth, LEAST_STEP_PX)[0]
        thresholds = view.work.load("thresholds").read("thresholds")
        self.pictures = Pictures(sampled_frames(view.work), thresholds, view.mask)

    def samples(self, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return features (n, F) and whether there is a contour (n,): of pixels on, beside and far from contours."""
        rows, columns = np.nonzero(self.near)
        angle = np.arctan2(self.across[rows, columns, 0], self.across[rows, columns, 1])
        bins = np.rint(angle / (2.0 * np.pi) * BINS).astype(int) % BINS
        parts = [(rows, columns, bins + turn, 1.0) for turn in (-1, 0, 1)]
        parts += [(rows, columns, bins + generator.integers(4, BINS - 3, len(bins)), 0.0) for _ in range(2)]
        distance = _distance(self.any)
        for limit, count in ((BESIDE_PX, N_BESIDE), (np.inf, N_ELSEWHERE)):
            rows, columns = np.nonzero(self.inside & (distance > NEAR_PX) & (distance <= limit))
            chosen = generator.permutation(len(rows))[:count]
            parts.append((rows[chosen], columns[chosen], generator.integers(0, BINS, len(chosen)), 0.0))
        features = np.concatenate([self.pictures.features(rows, columns, bins) for rows, columns, bins, _ in parts])
        return features, np.concatenate([np.full(len(part[0]), part[3]) for part in parts])

    def report(self, model: "Logistic") -> str:
        """Return a line on how well contours are told, and what they are worth."""
        log_odds = np.full((BINS, *self.inside.shape), -7.0)
        rows, columns = np.nonzero(self.inside)
        for number in range(BINS):
            log_odds[number][self.inside] = model.log_odds(self.pictures.features(rows, columns, number))
        score, bins = _linked(log_odds)
        view, labelled = self.view, _distance(self.any)
        parts = [view.errors(reconstruct_normals(view.clusters, view.mask, TRUE_CONTOURS_ALONE).normals)]
        for limit in LIMITS:
            contours = _ridges(score, bins, limit)
            beside = _distance(contours.near) <= NEAR_PX
            precision, recall = (labelled[contours.near] <= NEAR_PX).mean(), beside[self.near].mean()
            chance = (labelled[self.inside] <= NEAR_PX).mean(), beside[self.inside].mean()
            shares = f"{precision:.0%} ({chance[0]:.0%}) true, {recall:.0%} ({chance[1]:.0%}) of all"
            cuts = contours, contours.mirrored()
            errors = [view.errors(normals_with(view.clusters, view.mask, cut, has_rim=False)) for cut in cuts]
            parts.append(f"from {limit}: {shares}, {', mirrored '.join(errors)}")
        return "; ".join(parts)


def _distance(pixels: np.ndarray) -> np.ndarray:
    """Return the distance (H, W) to the nearest of these pixels (H, W) bool, infinite without any."""
    return ndimage.distance_transform_edt(~pixels) if pixels.any() else np.full(pixels.shape, np.inf)


class Logistic:
    """Logistic regression by iteratively reweighted least squares."""

    def __init__(self, features: np.ndarray, labels: np.ndarray) -> None:
        """Fit labels (n,) of 0 and 1 by features (n, F)."""
        self.mean, self.deviation = features.mean(axis=0), features.std(axis=0) + 1e-9
        self.coefficients = np.zeros(features.shape[1] + 1)
        design = self._design(features)
        for _ in range(12):
            probability = 1.0 / (1.0 + np.exp(-design @ self.coefficients))
            weight = np.maximum(probability * (1.0 - probability), 1e-6)
            gradient = design.T @ (labels - probability) - RIDGE * self.coefficients
            curvature = (design * weight[:, None]).T @ design + RIDGE * np.eye(design.shape[1])
            self.coefficients = self.coefficients + np.linalg.solve(curvature, gradient)

    def log_odds(self, features: np.ndarray) -> np.ndarray:
        """Return the logarithm of the odds (n,) of features (n, F)."""
        return np.asarray(self._design(features) @ self.coefficients)

    def _design(self, features: np.ndarray) -> np.ndarray:
        standard = np.clip((features - self.mean) / self.deviation, -5.0, 5.0)
        return np.concatenate([standard, np.ones((len(standard), 1))], axis=1)


def _linked(log_odds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest score (H, W) of all directions, averaged along the curve, and its direction (H, W)."""
    rows, columns = np.indices(log_odds.shape[1:]).astype(float)
    log_odds = np.clip(log_odds, -7.0, 7.0)
    # A curve may bend, at some cost.
    bent = np.maximum(log_odds, np.maximum(np.roll(log_odds, 1, axis=0), np.roll(log_odds, -1, axis=0)) - 0.3)
    result = []
    for number in range(BINS):
        down, right = _directions(number)
        total = log_odds[number].copy()
        for step in (*range(-LINK_PX, 0), *range(1, LINK_PX + 1)):
            places = [rows + step * right, columns - step * down]
            total += ndimage.map_coordinates(bent[number], places, order=1, mode="nearest")
        result.append(total / (2 * LINK_PX + 1))
    return 1.0 / (1.0 + np.exp(-np.max(result, axis=0))), np.argmax(result, axis=0)


def _ridges(score: np.ndarray, bins: np.ndarray, limit: float) -> Contours:
    """Return contours where a score (H, W) is the largest across the direction bins (H, W), and at least the limit."""
    rows, columns = np.indices(score.shape).astype(float)
    down, right = _directions(bins)
    smooth = ndimage.gaussian_filter(score, 0.7)
    near = score >= limit
    for sign in (1, -1):
        near &= smooth >= ndimage.map_coordinates(smooth, [rows + sign * down, columns + sign * right], order=1)
    numbers, count = ndimage.label(near, np.ones((3, 3)))
    near = np.isin(numbers, 1 + np.flatnonzero(ndimage.sum(near, numbers, np.arange(1, count + 1)) >= MIN_LENGTH_PX))
    right_cuts, down_cuts = (
        (near & (step > 0.3)) | np.roll(near & (step < -0.3), -1, axis=axis) for axis, step in ((1, right), (0, down))
    )
    return Contours(right_cuts, down_cuts, near, np.stack([right, -down, np.zeros(score.shape)], axis=-1))


def main() -> None:
    """Learn, and print a line per view as it is measured."""
    arguments = shapes_parser(__doc__, seed=102).parse_args()
    generator = np.random.default_rng(0)
    options = CaptureOptions(frames=1500, scale=0.8, seed=LEARNED_SEED, views=LEARNED_VIEWS)
    folder = arguments.folder and arguments.folder / "learned"
    learned = simulated_captures(LEARNED, folder, options)
    samples = [PicturedView(TrueView.of(capture, store)).samples(generator) for _, capture, store in learned]
    model = Logistic(*(np.concatenate(part) for part in zip(*samples, strict=True)))
    options = CaptureOptions(frames=1500, scale=0.8, seed=arguments.seed, views=TESTED_VIEWS)
    for name, capture, store in simulated_captures(arguments.shapes or ["puppy"], arguments.folder, options):
        print(f"{name}: {PicturedView(TrueView.of(capture, store)).report(model)}", flush=True)


if __name__ == "__main__":
    main()
