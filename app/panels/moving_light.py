"""Samples under a light that goes round, for the one under the pointer."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path

import numpy as np
from PyQt6.QtCore import QObject, QTimer, pyqtSignal
from PyQt6.QtGui import QPixmap

from app.document import U1
from app.panels.latest import Latest
from app.panels.pictures import pixmap
from app.tasks import Job, Report
from btfcore.errors import PatinaError
from btfcore.progress import Progress

FRAMES, FRAME_MS = 24, 70  # a turn takes 1.7 s
ELEVATION = np.radians(52.0)  # of the light from the normal
SIDE = 192  # pixels
REST_MS = 180  # before a sample that is only passed over is read
KEPT = 12  # samples whose frames are remembered, each at most 3.5 MB


class MovingLight(QObject):
    """Makes frames in the background and plays them; turned(path) when there is another one."""

    turned = pyqtSignal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        """Nothing is hovered yet."""
        super().__init__(parent)
        self.worker = Latest(self)
        self._path: Path | None = None
        self._at = 0
        self._frames: OrderedDict[Path, tuple[QPixmap, ...]] = OrderedDict()
        self._rest = QTimer(self)
        self._rest.setSingleShot(True)
        self._rest.setInterval(REST_MS)
        self._rest.timeout.connect(self._read)
        self._play = QTimer(self)
        self._play.setInterval(FRAME_MS)
        self._play.timeout.connect(self._turn)

    def hover(self, path: Path | None) -> None:
        """Show this sample under a moving light; None: none."""
        if path == self._path:
            return
        before, self._path, self._at = self._path, path, 0
        self._play.stop()
        self._rest.stop()
        if before is not None:
            self.turned.emit(before)
        if path is None:
            self.worker.stop()
        elif path in self._frames:
            self._start(path)
        else:
            self._rest.start()

    def frame(self, path: Path) -> QPixmap | None:
        """How it looks at this moment; None: as always."""
        frames = self._frames.get(path) if path == self._path else None
        return frames[self._at % len(frames)] if frames else None

    def forget(self, path: Path) -> None:
        """The file has changed."""
        self._frames.pop(path, None)
        if path == self._path:
            self.hover(None)

    def close(self) -> None:
        """Stop everything."""
        self._rest.stop()
        self._play.stop()
        self.worker.close()

    def _read(self) -> None:
        path = self._path
        if path is not None:
            self.worker.ask("frames", _job(path), lambda images: self._take(path, images))

    def _take(self, path: Path, images: tuple[U1, ...]) -> None:
        self._frames[path] = tuple(pixmap(image) for image in images)
        while len(self._frames) > KEPT:
            self._frames.popitem(last=False)
        if path == self._path:
            self._start(path)

    def _start(self, path: Path) -> None:
        self._frames.move_to_end(path)
        if len(self._frames[path]) > 1:
            self._play.start()

    def _turn(self) -> None:
        self._at += 1
        if self._path is not None:
            self.turned.emit(self._path)


def _job(path: Path) -> Job:
    def job(progress: Progress, report: Report) -> tuple[U1, ...]:
        try:
            return frames(path, progress=progress)
        except PatinaError:  # the thumbnail tells why
            return ()

    return job


def frames(path: Path, *, progress: Progress) -> tuple[U1, ...]:
    """Pictures (h, w, 3) u8 of a BTF from above under lights round about; () of a picture.

    Lights to which the same image is nearest share one. Raises what reading does.
    """
    from btfcore.btf.appearance import frontal_colours, nearest_pair
    from btfcore.btf.image import SUFFIXES
    from btfcore.files.samples import open_sample

    if path.suffix.lower() in SUFFIXES:
        return ()
    sample = open_sample(path, progress=progress)
    if sample.is_image:
        return ()
    made: dict[tuple[int, int], U1] = {}
    found = []
    above = np.array([0.0, 0.0, 1.0])
    for number in range(FRAMES):
        progress(number / FRAMES, "moving the light")
        turn = 2 * np.pi * number / FRAMES
        flat = np.sin(ELEVATION)
        light = np.array([flat * np.cos(turn), flat * np.sin(turn), np.cos(ELEVATION)])
        pair = nearest_pair(sample, above, light)
        if pair not in made:
            made[pair] = _small(frontal_colours(sample, light=light))
        found.append(made[pair])
    return tuple(found)


def _small(colours: np.ndarray) -> U1:
    """Reduce (H, W, 3) in 0–1 to at most `SIDE` a side."""
    step = max(1, -(-max(colours.shape[:2]) // SIDE))
    height, width = (side // step * step for side in colours.shape[:2])
    parts = colours[:height, :width].reshape(height // step, step, width // step, step, 3)
    small = np.clip(parts.mean(axis=(1, 3)), 0.0, 1.0)
    return np.ascontiguousarray(np.round(small * 255).astype(np.uint8))
