"""Report at once, when a run begins, what is wrong with the small files of captures."""

from collections.abc import Mapping, Sequence

from glint.flows.reporting.events import Message, Sink
from glint.storage.catalogue.models import Catalogue
from glint.storage.inputs.preflight import input_errors


def report_input_errors(catalogue: Catalogue, chosen: Mapping[str, Sequence[str]], sink: Sink) -> None:
    """Report all mistakes in the `.lp` files and the annotations of the chosen captures, before anything is decoded.

    chosen: ids of the captures by object. The captures themselves fail when their turn comes.
    """
    pairs = [(object_id, capture_id) for object_id, captures in chosen.items() for capture_id in captures]
    entries = (catalogue.object(object_id).capture(capture_id) for object_id, capture_id in pairs)
    for (object_id, capture_id), errors in zip(pairs, input_errors(entries), strict=True):
        for error in errors:
            sink.emit(Message(f"{error.message}: {error.remedy}", f"{object_id}/{capture_id}"))
