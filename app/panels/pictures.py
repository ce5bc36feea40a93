"""Pictures of samples as Qt draws them."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import QRect, Qt
from PyQt6.QtGui import QImage, QPixmap

from app.document import U1


def readable(path: Path) -> str:
    """Turn a file's name into words."""
    return path.stem.replace("_", " ").replace("-", " ")


def pixmap(image: U1) -> QPixmap:
    """Copy an (H, W, 3) u8 image."""
    height, width, _ = image.shape
    data = image.tobytes()
    return QPixmap.fromImage(
        QImage(data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()
    )


def middle(picture: QPixmap) -> QRect:
    """The largest square in the middle."""
    side = min(picture.width(), picture.height())
    return QRect((picture.width() - side) // 2, (picture.height() - side) // 2, side, side)


def square(picture: QPixmap, side: int, ratio: float = 1.0) -> QPixmap:
    """The middle of a picture, `side` logical pixels wide on a screen of that ratio."""
    pixels = max(1, round(side * ratio))
    smooth = Qt.TransformationMode.SmoothTransformation
    keep = Qt.AspectRatioMode.IgnoreAspectRatio
    found = picture.copy(middle(picture)).scaled(pixels, pixels, keep, smooth)
    found.setDevicePixelRatio(ratio)
    return found
