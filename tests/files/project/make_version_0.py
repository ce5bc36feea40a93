"""Writes the stored file of version 0; run once, kept to say where the file comes from.

Version 0 was a draft that nobody was given; the file shows that older ones are read.
"""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

from btfcore.files.project.write import write_project
from tests.files.project.projects import project

HERE = Path(__file__).parent


def older(manifest):
    """Return the manifest as version 0 had it."""
    manifest["version"] = 0
    manifest["knobs"] = manifest.pop("parameters")
    manifest["dense"]["rate"] = manifest["dense"].pop("size")
    for sample in manifest["samples"]:
        del sample["scale"]
    del manifest["quilt"]["counter"], manifest["token"], manifest["conventions"]
    manifest["layers"] = manifest.pop("edits")
    return manifest


def main(path):
    write_project(path, replace(project(), edits=project().edits[:2]))
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["manifest.json"] = json.dumps(older(json.loads(members["manifest.json"]))).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, body in members.items():
            archive.writestr(zipfile.ZipInfo(name), body)


if __name__ == "__main__":
    main(HERE / "version_0.patina")
