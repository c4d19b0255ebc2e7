"""The robustness matrix: which captures are perturbed in which ways, and the catalogue of what came of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import groupby
from pathlib import Path
from typing import Any

from glint.storage.catalogue.loading import Capture, Catalogue, Object, parameters_for
from glint.storage.errors import InputError
from glint.tasks.engine.parameters import Parameters, with_current_names
from glint.tasks.robustness.cells import Cell, CellTask
from glint.tasks.robustness.perturbations import PERTURBATIONS, QUICK, UNPERTURBED


@dataclass(frozen=True, slots=True)
class CaptureVariants:
    """A capture with ground truth, its parameters, and its simulations with the options of perturbations, by name."""

    capture: Capture
    parameters: Parameters
    variants: Mapping[str, Capture] = field(default_factory=dict)


def recorded_captures(catalogue: Catalogue) -> dict[str, CaptureVariants]:
    """Return the captures of a catalogue that have ground truth, by object, or by OBJECT-CAPTURE if it has several.

    Raises:
        InputError: two captures have the same name by this.
    """
    captures = {}
    for item in catalogue.objects:
        for capture in item.captures:
            name = item.id if len(item.captures) == 1 else f"{item.id}-{capture.id}"
            merged = parameters_for(catalogue, item.id, capture.id, with_current_names)
            if capture.truth is not None:
                if name in captures:
                    raise InputError(f"{name!r} names two captures, as object and as OBJECT-CAPTURE", "rename one")
                captures[name] = CaptureVariants(capture, Parameters.model_validate(merged))
    return captures


def simulated_variants(quick: bool) -> dict[str, Mapping[str, Any]]:
    """Return the options of all simulations that the matrix needs, by perturbation."""
    names = QUICK if quick else tuple(PERTURBATIONS)
    return {name: options for name in names if (options := PERTURBATIONS[name].options) or name == UNPERTURBED}


def simulated_captures(
    catalogue: Catalogue, shapes: Sequence[str], variants: Mapping[str, Any]
) -> dict[str, CaptureVariants]:
    """Return the captures of a catalogue whose objects are named SHAPE-PERTURBATION, by shape."""
    return {
        shape: CaptureVariants(
            catalogue.object(f"{shape}-{UNPERTURBED}").captures[0],
            Parameters(),
            {name: catalogue.object(f"{shape}-{name}").captures[0] for name in variants},
        )
        for shape in shapes
    }


def matrix_tasks(
    captures: Mapping[str, CaptureVariants], folder: Path, store: str, quick: bool, only: Sequence[str] = ()
) -> list[CellTask]:
    """Return the cells to measure, by capture; the unperturbed one of a capture comes first and is always measured.

    only: names or patterns, OBJECT or OBJECT/PERTURBATION.

    Raises:
        InputError: no capture has ground truth, or `only` names nothing.
    """
    chosen = [
        (name, perturbation)
        for name in captures
        for perturbation in (QUICK if quick else PERTURBATIONS)
        if not only or any(fnmatchcase(text, pattern) for pattern in only for text in (name, f"{name}/{perturbation}"))
    ]
    if not chosen:
        raise InputError(
            f"nothing can be perturbed ({', '.join(only) or 'no capture has ground truth'})",
            f"name one of {', '.join(captures)}, or OBJECT/PERTURBATION" if only else "give `truth` in the catalogue",
        )
    with_baselines = dict.fromkeys(
        pair for name, group in groupby(chosen, lambda pair: pair[0]) for pair in ((name, UNPERTURBED), *group)
    )
    return [
        CellTask(
            name,
            perturbation,
            captures[name].variants.get(perturbation, captures[name].capture),
            captures[name].parameters,
            folder / name / perturbation,
            store,
            is_simulated=perturbation in captures[name].variants,
        )
        for name, perturbation in with_baselines
    ]


def perturbed_catalogue(cells: Sequence[Cell]) -> Catalogue:
    """Return the catalogue of the perturbed captures: an object for each capture, a capture for each perturbation."""
    by_object: dict[str, list[Capture]] = {}
    for cell in cells:
        by_object.setdefault(cell.object_id, []).append(cell.entry)
    objects = [Object(id=name, captures=tuple(entries)) for name, entries in by_object.items()]
    return Catalogue.model_validate({"schema": 1, "name": "perturbed", "objects": tuple(objects)})
