"""Fetch the parts of others that flows/review/static/vendor/versions.json names: `python -m tests.vendored_parts`.

Needs npm, whose own configuration says where packages come from.
"""

import json
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path

VENDOR = Path(__file__).parents[1] / "flows/review/static/vendor"


def fetch(name: str, version: str, files: list[str]) -> None:
    """Put files of an npm package into NAME-VERSION/, and remove its other versions."""
    plain = name.removeprefix("@").replace("/", "-")
    for old in VENDOR.glob(f"{plain}-[0-9]*"):
        shutil.rmtree(old)
    with tempfile.TemporaryDirectory() as folder:
        command = ["npm", "pack", "--silent", f"{name}@{version}"]
        archive = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.split()[-1]
        with tarfile.open(Path(folder) / archive) as packed:
            for file in files:
                content = packed.extractfile(f"package/{file}")
                assert content is not None, file
                target = VENDOR / f"{plain}-{version}" / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content.read())


if __name__ == "__main__":
    for package, part in json.loads((VENDOR / "versions.json").read_text()).items():
        fetch(package, part["version"], part["files"])
