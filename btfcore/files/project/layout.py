"""Where in a project file what lies: members, and the arrays of each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack, ImageStack
from btfcore.files.project import schema
from btfcore.patch.connectivity import Connectivity, connect
from btfcore.quilt.layout import Layout
from btfcore.quilt.parameters import QuiltParameters
from btfcore.regions import Plan
from btfcore.types import Prepared

MANIFEST, PREVIEW, EDITS = "manifest.json", "preview.png", "edits.json"
MESH, DENSE, QUILT = "mesh.safetensors", "dense.safetensors", "quilt.safetensors"
EDIT_ARRAYS = "edits.safetensors"
Shape = tuple[int, ...]
Arrays = dict[str, NDArray[Any]]
Kinds = dict[str, tuple[np.dtype[Any], Shape]]
_F8, _F4, _I4, _U2 = (np.dtype(kind) for kind in ("<f8", "<f4", "<i4", "<u2"))


def sample_member(number: int) -> str:
    """Name of the member with a sample's arrays."""
    return f"samples/{number:04}.safetensors"


def netting(
    prepared: Prepared, plan: Plan | None, parameters: QuiltParameters
) -> tuple[Layout | None, Connectivity]:
    """Layout of the regions, and the connectivity, cut along hard borders, which numbers edges."""
    if plan is None:
        return None, connect(prepared.dense, prepared.field)
    layout = plan.layout(prepared.mesh, prepared.dense, prepared.field, parameters.border)
    return layout, layout.net


def mesh_kinds(manifest: schema.ProjectManifest) -> Kinds:
    """Kind and shape of the arrays of the input mesh and atlas."""
    vertices, faces = manifest.mesh.vertices, manifest.mesh.faces
    out = {
        "vertices": (_F8, (vertices, 3)), "faces": (_I4, (faces, 3)), "uv": (_F8, (faces, 3, 2)),
        "chart": (_I4, (faces,)),
    }  # fmt: skip
    return out | ({"region": (_I4, (faces,))} if manifest.mesh.labelled else {})


def dense_kinds(manifest: schema.ProjectManifest) -> Kinds:
    """Kind and shape of the arrays of the dense mesh and its field."""
    dense = manifest.dense
    count = dense.vertices
    return {
        "vertices": (_F8, (count, 3)), "normals": (_F4, (count, 3)),
        "faces": (_I4, (dense.faces, 3)), "texel": (_I4, (count, 2)), "chart": (_I4, (count,)),
        "face": (_I4, (count,)), "bary": (_F4, (count, 3)), "tangents": (_F4, (count, 3)),
        "singularities": (_F8, (dense.singularities, 3)),
    }  # fmt: skip


def quilt_kinds(manifest: schema.ProjectManifest) -> Kinds:
    """Kind and shape of the arrays of the background."""
    count, ghosts = manifest.dense.vertices, manifest.quilt.ghosts
    return {
        "source": (_F4, (count, 2)), "angle": (_F4, (count,)), "sample": (_U2, (count,)),
        "patch": (_I4, (count,)), "ghost_slots": (_I4, (ghosts,)), "ghosts": (_F4, (ghosts, 2)),
    }  # fmt: skip


def sample_kinds(entry: schema.SampleEntry) -> tuple[Kinds, set[str]]:
    """Kind and shape of a sample's arrays, and which may be missing; f4 may be stored as f2."""
    high, wide = entry.height, entry.width
    out: Kinds = {
        "colour": (_F4, (high, wide, 3)), "channels": (_F4, (high, wide, entry.channels)),
    }  # fmt: skip
    optional = {"channels"} if entry.channels == 3 else set()
    if entry.masked:
        out["mask"] = (_F4, (high, wide))
    material = entry.material
    if material is not None:
        count, rank = material.images, entry.rank
        size = (material.height, material.width)
        if material.encoding is None:
            out["image"] = (_F4, (1, *size, 3))
        else:
            out |= {
                "weights": (_F4, (*size, rank)), "basis": (_F4, (count, 3, rank)),
                "mean": (_F4, (count, 3)), "singular": (_F8, (rank,)),
            }  # fmt: skip
            out["index"] = (_I4, (len(material.views), len(material.lights)))
            optional.add("index")
        out["drawn"] = (_F4, size)
        optional.add("drawn")
    return out, optional


def material_of(btf: BtfSample) -> Arrays:
    """Arrays of a material: its factors, or the picture that it is."""
    out: Arrays = {}
    if btf.factors is not None:
        factors = btf.factors
        out = {
            "weights": factors.weights, "basis": factors.basis, "mean": factors.mean,
            "singular": factors.singular,
        }  # fmt: skip
        if not np.array_equal(btf.index, full_index(*btf.index.shape)):
            out["index"] = btf.index.astype(np.int32)
    else:
        out["image"] = btf.stack.read([0])
    if btf.mask is not None:
        out["drawn"] = np.asarray(btf.mask, np.float32)
    return out


def material_from(entry: schema.SampleEntry, arrays: Arrays) -> BtfSample | None:
    """Return the material of a sample's arrays; raises `InvalidBtf` where they do not fit."""
    known = entry.material
    if known is None:
        return None
    views, lights = known.directions()
    factors: BtfFactors | None = None
    stack: ImageStack
    if known.encoding is None:
        stack = ArrayStack(arrays["image"])
    else:
        code = known.encoding
        factors = BtfFactors(
            arrays["weights"], arrays["basis"], arrays["mean"], arrays["singular"],
            Encoding(code.name, code.epsilon, code.knee),
            error=float("nan") if known.error is None else known.error,
        )  # fmt: skip
        stack = FactorStack(factors)
    index = arrays.get("index", full_index(len(views), len(lights)))
    return BtfSample(
        known.name, stack, views, lights, index, mask=arrays.get("drawn"), tiles=known.tiles,
        texel_size=known.texel_size_mm, cosine=known.cosine, licence=known.licence,
        citation=known.citation, origin=known.origin, notes=tuple(known.notes), factors=factors,
    )  # fmt: skip
