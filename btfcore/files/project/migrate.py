"""Manifests of older versions brought to the newest, one version at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from btfcore.errors import InvalidProject

Manifest = dict[str, Any]


def _from_0(old: Manifest) -> Manifest:
    """Version 0 was a draft: other names, one scale for all samples, and no save token."""
    new = dict(old)
    new["parameters"] = new.pop("knobs")
    dense = dict(new["dense"])
    dense["size"] = dense.pop("rate")
    new["dense"] = dense
    new["samples"] = [{"scale": 1.0, **sample} for sample in new["samples"]]
    quilt = dict(new["quilt"])
    quilt.setdefault("counter", quilt["patches"])
    new["quilt"] = quilt
    new["edits"] = new.pop("layers")
    new.setdefault("token", "0" * 32)
    return new


# From version → to the next. A change of the schema adds a line here and a stored file to the
# tests; lines are never taken away.
STEPS: dict[int, Callable[[Manifest], Manifest]] = {0: _from_0}


def migrated(manifest: Manifest, version: int, newest: int, where: str) -> Manifest:
    """Bring `manifest` of `version` to `newest`; raises `InvalidProject` where it cannot be."""
    while version < newest:
        step = STEPS.get(version)
        if step is None:
            raise InvalidProject(
                f"{where}: version {version} of the project format is unknown; versions"
                f" {min(STEPS)} … {newest} are read"
            )
        try:
            manifest = step(manifest)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InvalidProject(
                f"{where}: its manifest of version {version} makes no sense: {error!r}"
            ) from None
        version += 1
        manifest["version"] = version
    return manifest
