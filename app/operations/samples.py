"""The verbs that put samples on offer, and environments around the surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PyQt6.QtCore import QObject

from app.document import Document
from app.operations.pictures import PictureOperations
from app.tasks import Report
from app.values import SampleEntry
from btfcore.btf.image import SUFFIXES as IMAGE_SUFFIXES
from btfcore.btf.image import read_images
from btfcore.errors import PatinaError
from btfcore.files.light_file import read_environment
from btfcore.files.package.read import read_package
from btfcore.files.package.write import SUFFIX as PACKAGE_SUFFIX
from btfcore.files.samples import thumbnail
from btfcore.progress import Progress, between
from btfcore.render.importance import LightTree, light_tree

SAMPLE_SUFFIXES = (*IMAGE_SUFFIXES, PACKAGE_SUFFIX)
THUMBNAIL = 192  # pixels a side, enough for 96 on a screen of double density
MOST_SAMPLES = 400  # of one folder


class SampleOperations(PictureOperations):
    """Reads samples' thumbnails and environments in the background."""

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """See `OperationsBase`."""
        super().__init__(document, parent)
        self._to_read: list[Path] = []
        self.reading.idle.connect(self._read_more)

    def offer(self, paths: Sequence[Path], *, choose: bool = False) -> None:
        """Put samples on offer; their thumbnails follow. `choose` takes the first."""
        paths = [path.absolute() for path in paths]
        fresh = [path for path in paths if path not in {e.path for e in self.document.samples}]
        self.document.offer_samples([SampleEntry(path) for path in fresh])
        self._to_read += fresh
        self._read_more()
        if choose and paths:
            self.document.choose_sample(paths[0])

    def offer_folder(self, folder: Path) -> None:
        """Put the samples of a folder on offer."""
        try:
            found = [path for path in sorted(folder.iterdir()) if is_sample(path)]
        except OSError as error:
            self.failed.emit(self.tr("{0} cannot be read: {1}").format(folder, error.strerror))
            return
        if not found:
            known = ", ".join(SAMPLE_SUFFIXES)
            self.failed.emit(self.tr("{0} holds no sample ({1}).").format(folder, known))
            return
        if len(found) > MOST_SAMPLES:
            text = self.tr("{0} holds {1} samples; the first {2} are shown.")
            self.noted.emit(text.format(folder, len(found), MOST_SAMPLES))
        self.offer(found[:MOST_SAMPLES])

    def open_environment(self, path: Path) -> bool:
        """Light the surface by a picture of all that is around; False while another is read."""

        def job(progress: Progress, report: Report) -> tuple[str, LightTree, tuple[str, ...]]:
            environment, notes = read_environment(path, progress=between(progress, 0.0, 0.7))
            return path.name, light_tree(environment), notes

        return self.opening.start("environment", job)

    def close(self) -> None:
        """Stop everything and wait until no thread of ours runs."""
        self._to_read = []
        super().close()

    def _finish(self, name: str, value: Any) -> None:
        if name == "thumbnails":
            self.document.offer_samples(value)
        elif name == "environment":
            source, tree, notes = value
            self.document.set_lighting(environment=tree, source=source, turn=0.0)
            for note in notes:
                self.noted.emit(f"{source}: {note}")
        else:
            super()._finish(name, value)

    def _read_more(self) -> None:
        """Decode the thumbnails that were asked for, all in one guarded child."""
        if not self._to_read or self.reading.busy:
            return
        paths, self._to_read = self._to_read, []
        self.reading.start("thumbnails", lambda progress, report: _thumbnails(paths, progress))


def is_sample(path: Path) -> bool:
    """Say whether a path looks like an image file or a sample package."""
    return path.suffix.lower() in SAMPLE_SUFFIXES and not path.name.startswith(".")


def _thumbnails(paths: Sequence[Path], progress: Progress) -> list[SampleEntry]:
    packages = [path for path in paths if path.suffix.lower() == PACKAGE_SUFFIX]
    entries = []
    for number, path in enumerate(packages):
        progress(number / len(paths), "reading samples")  # a chance to cancel
        entries.append(_package_entry(path))
    pictures = [path for path in paths if path not in packages]
    for path, read in zip(
        pictures, read_images(pictures, max_side=THUMBNAIL, progress=progress), strict=True
    ):
        if isinstance(read, PatinaError):
            entries.append(SampleEntry(path, error=str(read)))
        else:
            small = (np.clip(read.colour, 0, 1) * 255 + 0.5).astype(np.uint8)
            entries.append(SampleEntry(path, thumbnail=small))
    return entries


def _package_entry(path: Path) -> SampleEntry:
    """Show a package from above, lit obliquely; nothing foreign decodes it."""
    try:
        found = read_package(path)
        return SampleEntry(
            path, thumbnail=thumbnail(found, side=THUMBNAIL), feature=found.mask is not None
        )
    except PatinaError as error:
        return SampleEntry(path, error=str(error))
