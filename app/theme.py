"""The look of the window: a dark palette, and the few rules that the palette cannot say."""

from __future__ import annotations

from typing import TypeVar

from PyQt6.QtCore import QPointF, QRectF, Qt
from PyQt6.QtGui import QColor, QIcon, QLinearGradient, QPainter, QPainterPath, QPalette, QPixmap
from PyQt6.QtWidgets import QApplication, QWidget

W = TypeVar("W", bound=QWidget)
ACCENT = "#d98a3d"
ACCENT_TEXT = "#1d1712"
BASE, PANEL, RAISED, LINE = "#1f2124", "#282b2f", "#34383d", "#43484e"
TEXT, FAINT = "#e6e7e8", "#a3a9b0"
DANGER = "#7d2f2b"

_SHEET = f"""
QToolTip {{ color: {TEXT}; background: {RAISED}; border: 1px solid {LINE}; padding: 4px; }}
QWidget#panel {{ background: {PANEL}; }}
QLabel#heading {{ color: {FAINT}; font-weight: 600; letter-spacing: 1px; }}
QLabel#faint, QLabel#hint {{ color: {FAINT}; }}
QLabel#title {{ font-size: 20px; font-weight: 600; }}
QListView#samples {{ background: {BASE}; border: 1px solid {LINE}; border-radius: 6px;
    padding: 4px; outline: 0; }}
QSpinBox, QDoubleSpinBox, QComboBox {{ min-height: 26px; }}
QPushButton {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 5px;
    padding: 6px 12px; }}
QPushButton:hover {{ border-color: {FAINT}; }}
QPushButton:pressed {{ background: {LINE}; }}
QPushButton:disabled {{ color: #767c83; background: {PANEL}; }}
QPushButton:focus {{ border-color: {ACCENT}; }}
QPushButton#primary {{ background: {ACCENT}; color: {ACCENT_TEXT}; border: 1px solid {ACCENT};
    font-size: 15px; font-weight: 600; padding: 10px; }}
QPushButton#primary:hover {{ background: #e59c54; }}
QPushButton#primary:disabled {{ background: {RAISED}; color: #8b9197; border-color: {LINE}; }}
QPushButton#mode {{ border-radius: 0; padding: 5px 16px; margin: 0; }}
QPushButton#mode:checked {{ background: {ACCENT}; color: {ACCENT_TEXT}; border-color: {ACCENT}; }}
QProgressBar {{ background: {BASE}; border: 1px solid {LINE}; border-radius: 4px;
    text-align: center; min-height: 20px; }}
QProgressBar::chunk {{ background: #8a5a2b; border-radius: 3px; }}
QFrame#errors {{ background: {DANGER}; }}
QFrame#errors QLabel {{ color: #ffffff; }}
QFrame#errors QPushButton {{ background: transparent; border: 0; color: #ffffff;
    font-size: 16px; padding: 2px 8px; }}
QFrame#notes {{ background: #3a4450; }}
QFrame#notes QPushButton {{ background: transparent; border: 0; font-size: 16px;
    padding: 2px 8px; }}
QStatusBar {{ background: {PANEL}; border-top: 1px solid {LINE}; }}
QStatusBar QLabel {{ color: {FAINT}; padding: 3px 14px; }}
QStatusBar::item {{ border: 0; }}
QMenuBar {{ background: {PANEL}; }}
QMenuBar::item:selected {{ background: {RAISED}; }}
QFrame#drop {{ border: 2px dashed {LINE}; border-radius: 12px; }}
QSplitter::handle {{ background: {LINE}; }}
"""


def dress(application: QApplication) -> None:
    """Give the application the Fusion style in dark colours."""
    application.setStyle("Fusion")
    palette = QPalette()
    role = QPalette.ColorRole
    colours = {
        role.Window: PANEL, role.WindowText: TEXT, role.Base: BASE, role.AlternateBase: PANEL,
        role.Text: TEXT, role.Button: RAISED, role.ButtonText: TEXT, role.BrightText: "#ffffff",
        role.Highlight: ACCENT, role.HighlightedText: ACCENT_TEXT, role.Link: ACCENT,
        role.ToolTipBase: RAISED, role.ToolTipText: TEXT, role.PlaceholderText: FAINT,
        role.Light: LINE, role.Midlight: RAISED, role.Mid: LINE, role.Dark: BASE,
        role.Shadow: "#000000",
    }  # fmt: skip
    for each, colour in colours.items():
        palette.setColor(each, QColor(colour))
    for each in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, each, QColor("#767c83"))
    application.setPalette(palette)
    application.setStyleSheet(_SHEET)
    application.setWindowIcon(icon())


def named(widget: W, name: str) -> W:
    """Give a widget the name by which the style sheet knows it."""
    widget.setObjectName(name)
    return widget


def icon() -> QIcon:
    """Draw the application's icon: a ball sewn together from patches."""
    found = QIcon()
    for size in (16, 32, 64, 128):
        found.addPixmap(emblem(size))
    return found


def emblem(size: int, ratio: float = 1.0) -> QPixmap:
    """Draw the emblem, `size` logical pixels a side."""
    pixels = round(size * ratio)
    pixmap = QPixmap(pixels, pixels)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.scale(pixels / 100, pixels / 100)
    ball = QPainterPath()
    ball.addEllipse(QRectF(5, 5, 90, 90))
    painter.setClipPath(ball)
    shade = QLinearGradient(20, 5, 80, 95)
    shade.setColorAt(0, QColor("#edab6a"))
    shade.setColorAt(1, QColor("#7c4420"))
    painter.fillRect(QRectF(0, 0, 100, 100), shade)
    painter.setPen(Qt.PenStyle.NoPen)
    for colour, points in (
        ("#5f8f86", ((0, 30), (38, 40), (46, 70), (20, 100), (0, 100))),
        ("#c5b48c", ((52, 0), (100, 0), (100, 44), (70, 48), (48, 26))),
    ):
        patch = QPainterPath(QPointF(*points[0]))
        for point in points[1:]:
            patch.lineTo(*point)
        painter.fillPath(patch, QColor(colour))
    pen = painter.pen()
    pen.setStyle(Qt.PenStyle.DashLine)
    pen.setColor(QColor("#fff3dd"))
    pen.setWidthF(3.5)
    painter.setPen(pen)
    seam = QPainterPath(QPointF(0, 30))
    for point in ((38, 40), (48, 26), (70, 48), (100, 44)):
        seam.lineTo(*point)
    painter.drawPath(seam)
    down = QPainterPath(QPointF(38, 40))
    down.lineTo(46, 70)
    down.lineTo(20, 100)
    painter.drawPath(down)
    painter.end()
    pixmap.setDevicePixelRatio(ratio)
    return pixmap
