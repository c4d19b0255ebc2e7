"""Write catalogues as YAML, atomically."""

import io
import os
import tempfile
from pathlib import Path
from typing import Any

import obstore
from ruamel.yaml import YAML
from ruamel.yaml.representer import SafeRepresenter

from glint.storage.catalogue.models import ADDRESS_KEYS, Catalogue
from glint.storage.catalogue.yaml_lines import plain_value
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import Address, locate


def write(catalogue: Catalogue, path: Address) -> None:
    """Write a catalogue atomically; addresses below its folder become relative.

    Raises:
        OSError, StoreError: it cannot be written.
    """
    location = locate(path)
    data = catalogue.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    folder = location.parent.uri.rstrip("/") + "/"
    for item in data["objects"]:
        for entry in (item, *item["captures"]):
            for key in ADDRESS_KEYS:
                if key in entry:
                    entry[key] = entry[key].removeprefix(folder) or entry[key]
    text = yaml_text(data)
    if location.local is None:
        with store_errors(location.uri, "writing a catalogue"):
            obstore.put(location.parent.obstore(), location.name, text, use_multipart=False)
    else:
        _replace(location.local, text)


def yaml_text(data: Any) -> bytes:
    """Return JSON values as YAML, keys in the order of the mappings."""
    yaml = YAML(typ="safe")
    yaml.Representer = _Representer
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 110
    text = io.BytesIO()
    yaml.dump(data, text)
    return text.getvalue()


def _replace(path: Path, data: bytes) -> None:
    try:
        temporary = tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", suffix=".yaml", delete=False)  # noqa: SIM115
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    with temporary as file:
        try:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)  # noqa: PTH101
            Path(file.name).replace(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise


class _Representer(SafeRepresenter):
    """Represents text, in quotes if it would be read as another value."""

    def represent_str(self, data: str) -> Any:
        style = None if plain_value(data) == data else '"'
        return self.represent_scalar("tag:yaml.org,2002:str", data, style)


_Representer.add_representer(str, _Representer.represent_str)
