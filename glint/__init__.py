"""Read what Glint computed: surfaces of transparent objects from videos of their highlights.

    import glint
    capture = glint.open("s3://bucket/store")["wine-glass"].latest["front"]
    capture.normals          # (H, W, 3) float32, unit length, NaN outside the mask
    capture.point_cloud()    # points, normals and confidences of the surface

Importing this package costs next to nothing, and reading needs numpy, zarr, icechunk and obstore only. `glint.run` and
`glint.catalogue` need the rest: `pip install "glint[pipeline]"`. See docs/reading.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from glint import frames as frames
    from glint.reading import (
        Mesh,
        NotFoundError,
        PointCloud,
        Store,
        StoredCapture,
        StoredObject,
        StoredVersion,
        open,
    )
    from glint.scripting import catalogue, run

__all__ = [
    "Mesh",
    "NotFoundError",
    "PointCloud",
    "Store",
    "StoredCapture",
    "StoredObject",
    "StoredVersion",
    "catalogue",
    "frames",
    "open",
    "run",
]

_SCRIPTING = ("catalogue", "run")


def __getattr__(name: str) -> Any:
    """Return a public name, importing its module at the first use."""
    if name == "__version__":
        return import_module("importlib.metadata").version("glint")
    if name not in __all__:
        raise AttributeError(f"module 'glint' has no attribute {name!r}")
    if name == "frames":
        return import_module("glint.frames")
    return getattr(import_module("glint.scripting" if name in _SCRIPTING else "glint.reading"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*globals(), *__all__])
