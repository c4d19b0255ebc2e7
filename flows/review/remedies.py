"""What to do about a warning or an error, in the words of the review page: its tools rather than files and keys.

Stages say what to do in the words of `glint check` and the catalogue. On the page the same is done on the picture.
"""

import re

PAINT = "paint the mask with Brush, Polygon or Grow, and save"

PHRASES: tuple[tuple[str, str], ...] = (
    (
        r"correct it by hand: `glint check` writes [^;]* in red",
        "correct it with Brush, Eraser, Polygon or Grow, and save; Maximum shows the highlights",
    ),
    (r"paint a mask \(white object on black\) and name it as `mask: mask.png`", PAINT),
    (r"(it must have the frame's [^;]* pixels)", rf"\1; or {PAINT}"),
    (r"paint the object white on black, or leave the mask out to have it estimated", PAINT),
    (r"interrupted; what is finished is kept, and the same command goes on from there", "the run was interrupted"),
    (r"give the object's `region`", "draw the object's region with Region"),
    (r"give its centre and radius as `spheres: [^`]*` in the catalogue", "draw its circle with Spheres"),
    (r"give `spheres`( in the catalogue)?", "draw its circle with Spheres"),
    (r"give this capture `spheres: \[([^`]*)\]`", r"set its circle with Spheres to \1"),
    (r"`spheres` in the catalogue", "its circle with Spheres"),
    (r"; correct a `diameter_mm` or a radius", "; correct a diameter or a radius with Spheres"),
    (r"correct or remove it, or correct `diameter_mm`", "correct it with Scale, or the diameter with Spheres"),
    (r"correct it, or the sphere's circle", "correct it, or its circle, with Spheres"),
    (r"with cx along the width; correct it, unless", "with cx along the width; correct it with Camera, unless"),
    (r"give the camera's matrix \(`camera`\)", "give the camera's focal length with Camera"),
    (r"give the camera's matrix, about `camera: \{matrix: [^`]*\}`", "give it with Camera"),
    (r"check that `camera` is the matrix", "check with Camera that its matrix is that"),
    (r"give the millimetres that one pixel covers", "correct it with Scale"),
    (r"correct `pixel_size` or `diameter_mm` where it is wrong", "correct it with Scale or Spheres where it is wrong"),
    (r"give `pixel_size`, or a sphere's `diameter_mm`, for all views", "give it with Scale for all views"),
    (r"correct it in the catalogue \(pixels of the full frame\)", "correct it with Region"),
    (r"correct it \(pixels of the full frame, y down\)", "correct it with Spheres"),
    (r"the `pixel_size` or a sphere", "the scale or a sphere"),
    (r"`pixel_size`", "the scale"),
    (r"`diameter_mm`", "the sphere's diameter"),
)
"""Patterns of what stages say, and what the page says instead."""


def on_page(text: str) -> str:
    """Return a warning, an error or a remedy with what a person can do on the review page."""
    for pattern, words in PHRASES:
        text = re.sub(pattern, words, text)
    return text
