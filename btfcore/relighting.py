"""The verbs of rendering that command line and notebooks share: load, light, look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.colour import srgb_to_linear
from btfcore.btf.sample import BtfSample, from_picture
from btfcore.errors import InvalidParameter
from btfcore.files.light_file import LightSetting, lights_of
from btfcore.files.surface import ExportSurface, export_input
from btfcore.painting import Painting, open_project
from btfcore.progress import Progress, between, silent
from btfcore.render.backdrop import Backdrop, develop_picture, over
from btfcore.render.camera import Turntable
from btfcore.render.cast import Caster, caster
from btfcore.render.environment import Environment
from btfcore.render.evaluate import Evaluator
from btfcore.render.film import Shot, framing_all, moved_lights
from btfcore.render.gutter import gutter_source
from btfcore.render.importance import light_tree
from btfcore.render.lights import Lights, joined
from btfcore.render.material import (
    FactorMaterial,
    HarmonicMaterial,
    Material,
    material,
    truncated,
)
from btfcore.render.picture import Subject, render_linear
from btfcore.render.pool import shared_pool
from btfcore.render.raster import check_size
from btfcore.render.surfels import BARE, Placement, Surfels, placement, surfels
from btfcore.render.tonemap import displayed
from btfcore.types import F4, F8, I4, I8, Frozen, Prepared, Quilt

_ENVIRONMENT_ORDER = 4

U1 = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Relightable(Frozen):
    """A decorated surface with what it is lit by samples: shape, surfels, samples.

    surface: the input mesh with its atlas; place: into scene coordinates; gutter (size, size) i4:
    surfel of every texel; samples: by number, notes: sentences fit for a user.
    """

    name: str
    surface: ExportSurface
    place: Placement
    surfels: Surfels
    gutter: I4
    samples: tuple[BtfSample, ...]
    notes: tuple[str, ...] = ()

    @cached_property
    def subject(self) -> Subject:
        """The shape in scene coordinates."""
        surface = self.surface
        return Subject(
            self.place.to_scene(surface.positions), surface.uv, surface.faces, surface.closed,
            self.gutter,
        )  # fmt: skip


@dataclass(frozen=True)
class Look:
    """How pictures are made.

    size : width and height in pixels; samples : along each side of a pixel. per_pixel : see
    `btfcore.render.picture`. representation, interpolation : see `btfcore.render.material`; rank :
    of factors, None for all. shadows : parts of the surface cast them. exposure (stops), curve :
    see `btfcore.render.tonemap`. memory_mb : of raw images, and of what is fitted.
    """

    size: tuple[int, int] = (1200, 900)
    samples: int = 4
    per_pixel: bool = False
    representation: str = "auto"
    interpolation: str = "auto"
    rank: int | None = None
    shadows: bool = False
    exposure: float = 0.0
    curve: str = "clip"
    memory_mb: float = 2048


def relightable(
    name: str,
    prepared: Prepared,
    quilt: Quilt,
    samples: Sequence[BtfSample],
    *,
    notes: Sequence[str] = (),
    progress: Progress = silent,
) -> Relightable:
    """Return what is rendered of a quilt on a prepared mesh; raises `InvalidParameter`."""
    surface = export_input(prepared.mesh, prepared.atlas, progress=between(progress, 0.0, 0.4))
    place = placement(surface.positions)
    made = surfels(prepared.dense, prepared.field, quilt, place)
    gutter = gutter_source(prepared.dense, progress=between(progress, 0.4, 1.0))
    return Relightable(name, surface, place, made, gutter, tuple(samples), tuple(notes))


def of_painting(painting: Painting, name: str, *, progress: Progress = silent) -> Relightable:
    """Return what is rendered of a painting; a sample without its BTF is its colours."""
    samples, notes = [], list(painting.notes)
    for each in painting.materials:
        if each.btf is None:
            notes.append(f"sample {each.name} was stored without its images; its colours are used")
            colours = srgb_to_linear(each.sample.colour)
            samples.append(from_picture(each.name, colours, tiles=each.sample.tiles))
        else:
            samples.append(each.btf)
    document = painting.document
    return relightable(
        name, document.prepared, document.quilt(), samples, notes=notes, progress=progress
    )


def open_relightable(
    path: str | Path,
    *,
    samples: Sequence[str | Path] = (),
    quilt: str | Path | None = None,
    progress: Progress = silent,
) -> Relightable:
    """Read what is to be rendered: a project, or a decorated GLB with its samples.

    samples : for a GLB, in the order in which its quilt counts them; pictures are Lambertian.
    quilt : file of the quilting map (NPZ) where the GLB was not written to be lit anew. Raises
    `InvalidProject`, `InvalidMesh`, `InvalidQuilt`, `InvalidParameter` and what samples raise.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".patina":
        for option, given in (("samples", bool(samples)), ("a quilt", quilt is not None)):
            if given:
                raise InvalidParameter(f"{path.name} is a project and has its own; {option} given")
        painting = open_project(path, progress=between(progress, 0.0, 0.6))
        return of_painting(painting, path.stem, progress=between(progress, 0.6, 1.0))
    if suffix != ".glb":
        raise InvalidParameter(f"{path.name}: a project (.patina) or a decorated .glb is rendered")
    from btfcore.files.glb_read import read_decorated_glb

    progress(0.0, "reading the mesh")
    stored = read_decorated_glb(path, quilt)
    found = _samples_of(path, samples, stored.quilt, between(progress, 0.4, 0.8))
    place = placement(stored.surface.positions)
    made = surfels(stored.dense, stored.field, stored.quilt, place)
    gutter = gutter_source(stored.dense, progress=between(progress, 0.8, 1.0))
    notes = tuple(f"{each.name}: {note}" for each in found for note in each.notes)
    return Relightable(path.stem, stored.surface, place, made, gutter, found, notes)


def materials(
    subject: Relightable,
    *,
    representation: str = "auto",
    interpolation: str = "auto",
    rank: int | None = None,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> tuple[Material, ...]:
    """Return what each sample is rendered from; see `btfcore.render.material.material`.

    rank : keep so many factors at most; raises `InvalidParameter` below 0, and for "raw".
    """
    if rank is not None and (rank < 0 or representation in ("raw", "harmonics")):
        raise InvalidParameter(f"a rank of {rank} for {representation}: only factors have a rank")
    out = []
    for number, sample in enumerate(subject.samples):
        part = between(progress, number / len(subject.samples), (number + 1) / len(subject.samples))
        part(0.0, "preparing the samples")
        made = material(
            sample, representation=representation, method=interpolation, memory_mb=memory_mb,
            progress=part,
        )  # fmt: skip
        if rank is not None and isinstance(made, FactorMaterial) and not sample.is_image:
            made = truncated(made, min(rank, made.rank))
        out.append(made)
    return tuple(out)


class Renderer:
    """A relightable surface under lights: tables are made once, for any number of pictures."""

    def __init__(
        self,
        subject: Relightable,
        look: Look,
        lights: Sequence[LightSetting],
        *,
        environment: Environment | None = None,
        environment_lights: int = 256,
        progress: Progress = silent,
    ) -> None:
        """Prepare materials and environment; raises `InvalidParameter`."""
        check_size(look.size, look.samples)
        displayed(np.zeros(1), look.exposure, look.curve)
        self.subject = subject
        self.look = look
        self._lights = list(lights)
        self._environment = environment
        self._count = environment_lights
        self._tree = None if environment is None else light_tree(environment, environment_lights)
        made = materials(
            subject, representation=look.representation, interpolation=look.interpolation,
            rank=look.rank, memory_mb=look.memory_mb, progress=progress,
        )  # fmt: skip
        self._evaluator = Evaluator(made)
        self._harmonic = any(isinstance(each, HarmonicMaterial) for each in made)
        self._caster: Caster | None = None

    def camera(
        self, azimuth: float, elevation: float, distance: float | None = None, *, turns: int = 0
    ) -> Turntable:
        """Return a camera that frames the surface, or looks at its middle from `distance`.

        distance : in radii of the sphere around the bounding box. turns : pictures in which it
        goes around.
        """
        camera = Turntable(azimuth, elevation)
        if distance is not None:
            return replace(camera, distance=distance)
        width, height = self.look.size
        points = self.subject.subject.positions
        return framing_all(camera, points, aspect=width / height, turns=turns)

    def environment(self, shot: Shot) -> Environment | None:
        """Return the environment as a shot has it."""
        if self._environment is None:
            return None
        return replace(self._environment, rotation=self._environment.rotation + shot.turned)

    def lights(self, shot: Shot) -> Lights:
        """All lights of a shot, those of the environment last."""
        found = moved_lights(lights_of(self._lights, shot.camera.axes()), shot)
        around = self.environment(shot)
        if around is None or self._tree is None:
            return found
        count = min(self._count, self._tree.most)
        order = _ENVIRONMENT_ORDER if self._harmonic else None
        sampled = self._tree.lights(
            count, rotation=around.rotation, intensity=around.intensity, order=order
        )
        return joined([found, sampled])

    def linear(self, shot: Shot, *, progress: Progress = silent) -> F4:
        """Picture (H, W, 4) f4: linear radiance premultiplied by alpha, nothing behind it."""
        lights, pool = self.lights(shot), shared_pool()
        subject, look = self.subject, self.look

        def shade(chosen: I8, eye: F8, position: F8 | None) -> F4:
            visible = self._visible(chosen, lights)
            return self._evaluator.radiance(
                subject.surfels, eye, lights, chosen, position=position, visible=visible, pool=pool
            )

        return render_linear(
            subject.subject, shade, shot.camera, size=look.size, samples=look.samples,
            per_pixel=look.per_pixel, progress=progress,
        )  # fmt: skip

    def radiance(self, shot: Shot, backdrop: Backdrop, *, progress: Progress = silent) -> F4:
        """Picture (H, W, 4) f4 of linear radiance before a backdrop, premultiplied."""
        picture = self.linear(shot, progress=progress)
        return over(picture, self._backdrop(backdrop, shot), shot.camera)

    def picture(self, shot: Shot, backdrop: Backdrop, *, progress: Progress = silent) -> U1:
        """Developed picture, see `btfcore.render.backdrop.develop_picture`."""
        return develop_picture(
            self.linear(shot, progress=progress), self._backdrop(backdrop, shot), shot.camera,
            exposure=self.look.exposure, curve=self.look.curve,
        )  # fmt: skip

    def _backdrop(self, backdrop: Backdrop, shot: Shot) -> Backdrop:
        if backdrop.environment is None:
            return backdrop
        return Backdrop(environment=self.environment(shot))

    def _visible(self, chosen: I8, lights: Lights) -> F4 | None:
        """Shares (L, n) of the lights that reach surfels; None where no shadows are cast."""
        if not self.look.shadows:
            return None
        if self._caster is None:
            shape = self.subject.subject
            self._caster = caster(shape.positions, shape.faces, self.subject.surfels)
        return self._caster.visibility(lights, chosen, pool=shared_pool())


# --- inside


def _samples_of(
    path: Path, given: Sequence[str | Path], quilt: Quilt, progress: Progress
) -> tuple[BtfSample, ...]:
    """Open the samples; raises `InvalidParameter` where the quilt names more."""
    from btfcore.files.samples import open_sample

    named = quilt.sample[quilt.patch >= 0]
    needed = int(named[named != BARE].max(initial=0)) + 1 if len(named) else 0
    if len(given) < needed:
        raise InvalidParameter(
            f"the quilt of {path.name} names {needed} samples, {len(given)} are given"
        )
    out = []
    for number, each in enumerate(given):
        part = between(progress, number / len(given), (number + 1) / len(given))
        out.append(open_sample(each, progress=part))
    return tuple(out)
