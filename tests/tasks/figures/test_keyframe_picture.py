import numpy as np

from glint.tasks.figures.keyframe_picture import GRID_COLOUR, LABEL_PX, TITLE_PX, draw_keyframe

LEFT, TOP, ZOOM = 95, 196, 10


def lines(picture: np.ndarray, opacity: float) -> tuple[list[int], list[int]]:
    """Return columns and rows of the full frame, from the region's corner on, at which a black frame has such lines."""
    colour = (np.array(GRID_COLOUR) * opacity).astype(np.uint8)
    region = picture[TITLE_PX + LABEL_PX - 20 :, LABEL_PX:][: 40 * ZOOM]
    is_line = (region == colour).all(axis=-1)
    columns, rows = np.flatnonzero(is_line.mean(axis=0) > 0.8), np.flatnonzero(is_line.mean(axis=1) > 0.8)
    assert (columns % ZOOM == ZOOM // 2).all() and (rows % ZOOM == ZOOM // 2).all(), "through the pixels' centres"
    return (columns // ZOOM + LEFT).tolist(), (rows // ZOOM + TOP).tolist()


def test_the_grid_counts_the_pixels_of_the_full_frame() -> None:
    picture = draw_keyframe(np.zeros((40, 70), np.uint8), 12, LEFT, TOP, width=70 * ZOOM)
    assert picture.shape == (40 * ZOOM + LABEL_PX + TITLE_PX, 70 * ZOOM + LABEL_PX, 3) and picture.dtype == np.uint8
    assert lines(picture, 0.45) == ([100, 150], [200])
    assert lines(picture, 0.18) == ([110, 120, 130, 140, 160], [210, 220, 230])
    # The numbers of lines stand in the margins.
    assert (picture[: TITLE_PX + LABEL_PX - 20, LABEL_PX:] < 100).any() and (picture[:, :LABEL_PX] < 100).any()


def test_levels_of_16_bits_are_shown_as_8_bits() -> None:
    frame = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    eight_bits, sixteen_bits = (draw_keyframe(levels, 1, 1, 1) for levels in (frame, frame.astype(np.uint16) * 257))
    assert np.array_equal(eight_bits, sixteen_bits)
