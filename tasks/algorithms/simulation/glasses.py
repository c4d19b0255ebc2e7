"""Profiles of glasses: the paper's wine glass and water glass, and others whose feet and lips differ from theirs."""

GLASSES = {
    "wine-glass": (
        (0, -150), (52, -150), (52, -146), (10, -140), (5, -130), (5, -50), (10, -45), (40, -20), (58, 20),
        (58, 70), (50, 140), (47.5, 140), (55, 70), (55, 20), (38, -16), (8, -40), (0, -41),
    ),
    "water-glass": ((0, -120), (55, -120), (70, 120), (66, 120), (51, -106), (0, -106)),
    "goblet": (
        (0, -110), (60, -110), (60, -102), (14, -92), (8, -80), (8, -40), (16, -30), (50, 0), (62, 50),
        (60, 110), (56.5, 110), (58, 50), (46, 4), (12, -24), (0, -25),
    ),
    "tumbler": ((0, -70), (45, -70), (60, 70), (54, 70), (41, -52), (0, -54)),
    "coupe": (
        (0, -100), (48, -100), (48, -97), (8, -91), (4, -84), (4, -10), (14, 0), (50, 18), (64, 50),
        (62, 51), (48, 21), (12, 4), (0, 4),
    ),
}  # fmt: skip
"""Radius and height of the corners, from the bottom along the outside to the lip, and down the inside."""
GLASS_TILT_DEG = {"wine-glass": 14.0, "water-glass": 14.0, "goblet": 20.0, "tumbler": 25.0, "coupe": 10.0}
"""Angle by which the camera looks down on each."""
