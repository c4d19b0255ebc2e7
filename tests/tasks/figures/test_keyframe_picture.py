import numpy as np

from glint.tasks.figures.keyframe_picture import draw_keyframe


def test_a_keyframe_is_enlarged_with_its_grid() -> None:
    frame = np.zeros((40, 70), np.uint8)
    picture = draw_keyframe(frame, 12, 100, 200, width=700)
    assert picture.dtype == np.uint8 and picture.shape[1] >= 700
    assert (picture == 255).all(axis=-1).any() and picture[200:, 200:].max() > 0
    assert draw_keyframe(frame.astype(np.uint16) * 257, 1, 0, 0).shape[2] == 3
