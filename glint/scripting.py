"""Run catalogues from scripts. Needs what `pip install "glint[pipeline]"` installs."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from os import PathLike, fspath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from glint.flows.pipeline.run import Summary
    from glint.storage.catalogue.models import Catalogue


def catalogue(address: str | PathLike[str]) -> "Catalogue":
    """Load and check a catalogue: a path, or an address s3://bucket/key or az://container/key.

    Raises:
        CatalogueError: everything that is wrong with it, by lines.
        InputError, StoreError: it cannot be read.
        ImportError: the pipeline is not installed.
    """
    with _pipeline_required("glint.catalogue"):
        from glint.tasks.engine.references import load_catalogue

    return load_catalogue(fspath(address))


def run(
    catalogue: str | PathLike[str],
    *,
    store: str | PathLike[str],
    only: Sequence[str] = (),
    scheduler: str | None = None,
    workers: int | None = None,
    rehash: bool = False,
    drift: float | None = None,
    adopt: bool = False,
) -> "Summary":
    """Run a catalogue as `glint run` does, with progress on standard error; return how captures and objects ended.

    only: objects or captures ("wine-glass", "wine-glass/front"), by default all. scheduler: the address of a Dask
    scheduler, by default a cluster of `workers` processes on this machine. rehash: read all inputs again. drift: warn
    if the 95th percentile of normal change against the previous version exceeds so many degrees.
    adopt: continue objects that another catalogue has published from other videos.
    A script must call this under `if __name__ == "__main__":`, since worker processes import the script.

    Raises:
        CatalogueError, InputError: the catalogue is unusable. RunningError: the Prefect server or the cluster is.
        ImportError: the pipeline is not installed.
    """
    with _pipeline_required("glint.run"):
        from glint.flows.pipeline.run import run as run_pipeline
        from glint.flows.reporting.console import open_console

    with open_console() as console:
        return run_pipeline(
            fspath(catalogue),
            fspath(store),
            console,
            only=only,
            scheduler=scheduler,
            workers=workers,
            rehash=rehash,
            drift=drift,
            adopt=adopt,
        )


@contextmanager
def _pipeline_required(name: str) -> Iterator[None]:
    """Raise an ImportError that says how to install the pipeline where it, or what an import needs, is missing."""
    try:
        distribution("prefect")  # looked for, not imported: its settings are read when it is imported
        yield
    except (ModuleNotFoundError, PackageNotFoundError) as error:
        missing = error.name
        raise ImportError(f"{name} needs {missing}: pip install 'glint[pipeline]'", name=missing) from error
