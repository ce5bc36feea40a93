"""A sample and its mask as images to be painted at any zoom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PyQt6.QtCore import QPointF, QRectF, Qt
from PyQt6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF

from btfcore.btf.mask_history import Box
from btfcore.types import F4

SMALLEST = 64  # shorter side in pixels to which pictures are halved for small views
TINTS = ("#ff3b30", "#35d04a", "#2f8cff", "#ff2fd6")


class MaskPicture:
    """Keeps what drawing needs: halved copies of the sample, and the tinted mask.

    The mask is reduced by the greatest of each block, so that lines one texel wide stay to be
    seen however small the view is.
    """

    def __init__(self, colour: F4, mask: F4) -> None:
        """Start with the colours (H, W, 3) f4 in 0–1 and the mask (H, W) f4."""
        self._levels: list[QImage] = []
        self._kept: list[NDArray[np.uint8]] = []  # whose memory the images show
        self._alpha = _bytes(mask)
        self._level = 0
        self._reduced = self._alpha  # of the level: the greatest of each block
        self.set_colour(colour)
        self.set_tint(QColor(TINTS[0]))

    @property
    def tint(self) -> QColor:
        """Colour of the marked part."""
        return self._tint

    def set_tint(self, tint: QColor) -> None:
        """Show the mask in another colour."""
        self._tint = tint
        red, green, blue, _ = tint.getRgb()
        alpha = np.arange(256, dtype=np.uint32)
        colours = alpha << 24
        for value, shift in ((red, 16), (green, 8), (blue, 0)):
            colours |= (alpha * np.uint32(value or 0) // 255) << shift
        self._colours: NDArray[np.uint32] = colours.astype(np.uint32)

    def set_colour(self, colour: F4) -> None:
        """Show other colours (H, W, 3) of the same size."""
        self.height, self.width = colour.shape[:2]
        coded = np.empty((self.height, self.width, 4), np.uint8)
        coded[..., 3] = 255
        for k in range(3):  # blue, green, red lie in the memory of 0xAARRGGBB
            coded[..., 2 - k] = _bytes(colour[..., k])
        self._kept = [coded]
        while min(self._kept[-1].shape[:2]) >= 2 * SMALLEST:
            self._kept.append(_halved(self._kept[-1]))
        self._levels = [_image(each.view(np.uint32)[..., 0]) for each in self._kept]

    def set_mask(self, mask: F4, box: Box) -> None:
        """Take over the mask (H, W) within a box, already reduced where needed."""
        left, top, right, bottom = box
        self._alpha[top:bottom, left:right] = _bytes(mask[top:bottom, left:right])
        block = 1 << self._level
        rows = slice(top // block, -(-bottom // block))
        columns = slice(left // block, -(-right // block))
        part = self._alpha[
            rows.start * block : rows.stop * block, columns.start * block : columns.stop * block
        ]
        self._reduced[rows, columns] = _greatest(part, self._level)

    def draw(
        self, painter: QPainter, zoom: float, visible: QRectF, opacity: float, ratio: float
    ) -> None:
        """Draw what is `visible` (in texels) with a painter in units of the view.

        The upper left corner of texel (0, 0) lies at 0; zoom: units a texel, `ratio` pixels a
        unit. Enlarged, texels are squares with sharp edges.
        """
        scale = zoom * ratio
        level = 0 if scale >= 1 else int(np.floor(np.log2(1 / scale)))
        level = min(level, len(self._levels) - 1)
        if level != self._level:
            self._level = level
            self._reduced = _greatest(self._alpha, level)
        block = 1 << level
        left, top = (max(int(v // block), 0) for v in (visible.left(), visible.top()))
        right = min(int(visible.right() // block) + 1, -(-self.width // block))
        bottom = min(int(visible.bottom() // block) + 1, -(-self.height // block))
        if right <= left or bottom <= top:
            return
        source = QRectF(left, top, right - left, bottom - top)
        step = block * zoom
        target = QRectF(left * step, top * step, (right - left) * step, (bottom - top) * step)
        painter.save()
        painter.setClipRect(QRectF(0, 0, self.width * zoom, self.height * zoom))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, scale < 1)
        painter.drawImage(target, self._levels[level], source)
        painter.setOpacity(painter.opacity() * opacity)
        # only what is seen is tinted, so that large samples cost no more than small ones
        tinted = np.take(self._colours, self._reduced[top:bottom, left:right])
        painter.drawImage(target, _image(tinted), QRectF(0, 0, right - left, bottom - top))
        painter.restore()


def draw_outline(painter: QPainter, points: list[QPointF]) -> None:
    """Draw a lasso that is not closed yet, to be seen on any ground."""
    line = QPolygonF(points)
    painter.setPen(QPen(QColor(0, 0, 0, 200), 2))
    painter.drawPolyline(line)
    painter.setPen(QPen(QColor(255, 255, 255), 1, Qt.PenStyle.DashLine))
    painter.drawPolyline(line)
    painter.setPen(QPen(QColor(255, 255, 255, 130), 1, Qt.PenStyle.DotLine))
    painter.drawLine(points[-1], points[0])


def draw_pointer(painter: QPainter, at: QPointF, circles: tuple[float, ...], removes: bool) -> None:
    """Draw a brush's contour and reach, and whether the tool adds or removes."""
    dark, light = QPen(QColor(0, 0, 0, 190), 2.6), QPen(QColor(255, 255, 255), 1.2)
    offset = 10.0
    if circles:
        radius, far = circles
        offset = radius * 0.71 + 6
        for pen in (dark, light):
            painter.setPen(pen)
            painter.drawEllipse(at, radius, radius)
        if far > radius + 3:
            painter.setPen(QPen(QColor(255, 255, 255, 150), 1, Qt.PenStyle.DotLine))
            painter.drawEllipse(at, far, far)
    sign = at + QPointF(offset, offset)
    for pen in (dark, light):
        painter.setPen(pen)
        painter.drawLine(sign - QPointF(4, 0), sign + QPointF(4, 0))
        if not removes:
            painter.drawLine(sign - QPointF(0, 4), sign + QPointF(0, 4))


def _image(pixels: NDArray[np.uint32]) -> QImage:
    """Image upon (h, w) u4 premultiplied ARGB, which must outlive it."""
    height, width = pixels.shape
    form = QImage.Format.Format_ARGB32_Premultiplied
    return QImage(pixels.data, width, height, 4 * width, form)  # type: ignore[call-overload]


def _bytes(values: F4) -> NDArray[np.uint8]:
    """Values of 0–1 in 0–255, rounded."""
    coded = values * np.float32(255)
    coded += np.float32(0.5)
    return coded.astype(np.uint8)


def _halved(coded: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Means of blocks of 2 x 2 of (h, w, 4); an odd last row or column counts twice."""
    height, width = coded.shape[:2]
    if height % 2 or width % 2:
        coded = np.pad(coded, ((0, height % 2), (0, width % 2), (0, 0)), "edge")
    sums = coded[0::2, 0::2].astype(np.uint16)
    sums += coded[1::2, 0::2]
    sums += coded[0::2, 1::2]
    sums += coded[1::2, 1::2]
    return ((sums + 2) >> 2).astype(np.uint8)


def _greatest(values: NDArray[np.uint8], level: int) -> NDArray[np.uint8]:
    """Greatest values of blocks of 2^level a side; those at the end may be smaller."""
    for _ in range(level):
        height, width = values.shape
        if height % 2 or width % 2:
            values = np.pad(values, ((0, height % 2), (0, width % 2)))
        rows = np.maximum(values[0::2], values[1::2])
        values = np.maximum(rows[:, 0::2], rows[:, 1::2])
    return values
