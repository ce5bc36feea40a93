"""Small pictures of lines, drawn in whatever colour the palette has at whatever size."""

from __future__ import annotations

from collections.abc import Callable

from PyQt6.QtCore import QPointF, QRectF, Qt
from PyQt6.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap

SIDE = 24.0  # units of the drawings below
_RATIO = 3.0  # pixels to a logical one: enough for every screen


def draw_glyph(painter: QPainter, name: str, place: QRectF, colour: QColor) -> None:
    """Draw the glyph `name`, one of `GLYPHS`, into a square."""
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(place.topLeft())
    painter.scale(place.width() / SIDE, place.height() / SIDE)
    pen = QPen(colour, 1.8)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(GLYPHS[name]())
    painter.restore()


def glyph_icon(name: str, colour: QColor, side: int = 18) -> QIcon:
    """Return the glyph as an icon for buttons, dimmed where they are disabled."""
    icon = QIcon()
    faint = QColor(colour)
    faint.setAlphaF(0.35)
    for mode, ink in ((QIcon.Mode.Normal, colour), (QIcon.Mode.Disabled, faint)):
        pixels = round(side * _RATIO)
        picture = QPixmap(pixels, pixels)
        picture.fill(Qt.GlobalColor.transparent)
        painter = QPainter(picture)
        draw_glyph(painter, name, QRectF(0, 0, pixels, pixels), ink)
        painter.end()
        picture.setDevicePixelRatio(_RATIO)
        icon.addPixmap(picture, mode)
    return icon


def _lines(*lines: tuple[tuple[float, float], ...]) -> QPainterPath:
    path = QPainterPath()
    for line in lines:
        path.moveTo(QPointF(*line[0]))
        for point in line[1:]:
            path.lineTo(QPointF(*point))
    return path


def _brush() -> QPainterPath:
    path = _lines(((20, 4), (11, 13)))
    path.moveTo(11, 13)
    path.cubicTo(6, 12, 7, 18, 3, 19)
    path.cubicTo(8, 21, 14, 19, 11, 13)
    return path


def _stamp() -> QPainterPath:
    path = _lines(((4, 20), (20, 20)), ((5, 16), (19, 16), (19, 13), (14, 13)))
    path.addEllipse(QPointF(12, 6.5), 3.5, 3.5)
    path.addPath(_lines(((10.5, 10), (10, 13), (5, 13), (5, 16)), ((13.5, 10), (14, 13))))
    return path


def _erase() -> QPainterPath:
    corners = (8, 19), (3, 14), (13, 4), (20, 11), (12, 19)
    return _lines((*corners, corners[0]), ((8, 9), (15, 16)), ((8, 19), (21, 19)))


def _repair() -> QPainterPath:
    path = QPainterPath()
    path.addRoundedRect(QRectF(2.5, 8, 19, 8), 4, 4)
    path.addPath(_lines(((8.5, 8), (8.5, 16)), ((15.5, 8), (15.5, 16))))
    path.addPath(_lines(((12, 10.5), (12, 13.5)), ((10.5, 12), (13.5, 12))))
    return path


def _requilt() -> QPainterPath:
    seam = (3, 12), (7, 8), (11, 15), (15, 8), (21, 13)
    return _lines(seam, ((3, 3), (21, 3), (21, 21), (3, 21), (3, 3)))


def _eye() -> QPainterPath:
    path = QPainterPath(QPointF(2, 12))
    path.cubicTo(6, 4, 18, 4, 22, 12)
    path.cubicTo(18, 20, 6, 20, 2, 12)
    path.addEllipse(QPointF(12, 12), 3, 3)
    return path


def _eye_shut() -> QPainterPath:
    path = QPainterPath(QPointF(2, 11))
    path.cubicTo(6, 18, 18, 18, 22, 11)
    path.addPath(_lines(((5, 14.5), (3.5, 17)), ((12, 16.5), (12, 19.5)), ((19, 14.5), (20.5, 17))))
    return path


def _bin() -> QPainterPath:
    return _lines(
        ((4, 6), (20, 6)), ((9, 6), (9.5, 3), (14.5, 3), (15, 6)),
        ((6, 6), (7, 21), (17, 21), (18, 6)), ((10, 10), (10.3, 17)), ((14, 10), (13.7, 17)),
    )  # fmt: skip


def _copy() -> QPainterPath:
    path = QPainterPath()
    path.addRoundedRect(QRectF(8, 8, 13, 13), 2, 2)
    path.addPath(_lines(((5, 16), (3, 16), (3, 3), (16, 3), (16, 5))))
    return path


def _cross() -> QPainterPath:
    return _lines(((5, 5), (19, 19)), ((19, 5), (5, 19)))


def _fresh() -> QPainterPath:
    path = QPainterPath()
    path.arcMoveTo(QRectF(4, 4, 16, 16), 40)
    path.arcTo(QRectF(4, 4, 16, 16), 40, 285)
    path.addPath(_lines(((19.5, 3), (18.4, 7.2), (14.2, 6.4))))
    return path


def _plus() -> QPainterPath:
    return _lines(((12, 4), (12, 20)), ((4, 12), (20, 12)))


def _list() -> QPainterPath:
    return _lines(*(((x, y), (e, y)) for y in (6, 12, 18) for x, e in ((3, 4), (8, 21))))


GLYPHS: dict[str, Callable[[], QPainterPath]] = {
    "paint": _brush,
    "stamp": _stamp,
    "erase": _erase,
    "repair": _repair,
    "requilt": _requilt,
    "eye": _eye,
    "eye_shut": _eye_shut,
    "bin": _bin,
    "copy": _copy,
    "cross": _cross,
    "fresh": _fresh,
    "plus": _plus,
    "list": _list,
    "up": lambda: _lines(((12, 20), (12, 5)), ((6, 11), (12, 5), (18, 11))),
    "down": lambda: _lines(((12, 4), (12, 19)), ((6, 13), (12, 19), (18, 13))),
}
