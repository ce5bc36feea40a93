"""What a project file holds, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field

from btfcore.btf.sample import BtfSample
from btfcore.paint.delta import Delta
from btfcore.paint.edits import AnyEdit
from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.regions import Plan
from btfcore.types import Prepared, Sample

Figures = dict[str, int | float | tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Material:
    """A sample of a project.

    name: by which edits files call it; sample: what quilting sees; scale: times the
    parameters' common one; btf: the whole material, a picture or a factorised BTF, so that it
    can be lit anew and joined with others, or None; file: name of the file it came from.
    """

    name: str
    sample: Sample
    scale: float = 1.0
    btf: BtfSample | None = None
    file: str = ""


@dataclass(frozen=True, eq=False)
class StoredEdit:
    """An edit, its delta (None: not computed yet) and the figures of its report."""

    edit: AnyEdit
    delta: Delta | None = None
    figures: Figures | None = None


@dataclass(frozen=True, eq=False)
class Project:
    """Everything needed to go on painting.

    background: the quilt below all edits; edits: bottom first; tokens: how many deltas were
    ever made; patches: the state's counter of patches; plan: which sample has which region,
    where there are several; token: names this very save, "" before the first; net: the
    half-edges of the quilt, None: to be found; notes: what reading left to say.
    """

    prepared: Prepared
    parameters: QuiltParameters
    materials: tuple[Material, ...]
    background: QuiltState
    edits: tuple[StoredEdit, ...] = ()
    next_uid: int = 0
    tokens: int = 0
    patches: int = 0
    plan: Plan | None = None
    token: str = ""
    net: Connectivity | None = None
    notes: tuple[str, ...] = field(default=())
