"""What candidate normals say about their lights: scores of the axes, turn and integrability of stored captures.

    python -m tests.benchmarks.light_evidence STORE [OBJECT ..]

on a store of `glint evaluate --perturbed` (`store` in its folder) or of `glint run`: a line for each capture.
"""

import argparse

from scipy import ndimage

from glint.storage.catalogue.loading import Capture
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, object_ids
from glint.tasks.algorithms.sheets.light_evidence import light_evidence
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.stages.clusters import load_clusters


def main(store: str, objects: list[str]) -> None:
    """Print the evidence of every capture of the objects whose labels are stored."""
    place = Location.parse(store)
    for object_id in objects or list(object_ids(place)):
        repository = ObjectRepository.open(place, object_id, create=False)
        names = [name for name in sorted(repository.captures()) if repository.stage_key(name, "labels")]
        for name in names:
            context = CaptureContext(place.uri, object_id, Capture(id=name, frames="-"), Parameters())
            clusters, mask = load_clusters(context), context.load("mask").read("mask")
            evidence = light_evidence(
                clusters.normals,
                context.load("labels").read("labels"),
                context.load("silhouette").read("initial"),
                mask & (clusters.observations > 0),
                float(ndimage.distance_transform_edt(mask).max()),
            )
            print(
                f"{object_id}/{name}: {evidence.axes} {evidence.axes_ratio:.2f}, turned {evidence.turn_deg:.1f} +-"
                f" {evidence.turn_error_deg:.1f}, {evidence.log_ratio:+.2f} nats,"
                f" half vectors {evidence.half_ratio:.2f}"
                f" {'OTHER AXES ' * evidence.has_other_axes}{'TURNED ' * evidence.is_turned}"
                f"{'HALF VECTORS ' * evidence.has_half_vectors}{'NO SURFACE' * evidence.has_no_surface}",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("store")
    parser.add_argument("objects", nargs="*", metavar="OBJECT")
    arguments = parser.parse_args()
    main(arguments.store, arguments.objects)
