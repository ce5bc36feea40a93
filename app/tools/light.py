"""The tool that moves the main lamp."""

from __future__ import annotations

from collections.abc import Callable

from PyQt6.QtCore import QObject, Qt

from app.document import Document
from app.tools.base import Hand, PointerEvent, Stage, Tool
from app.values import Mode


class LightTool(Tool):
    """Drags move the lamp over a ball around the surface; light is shown for it."""

    name = "light"
    cursor = Qt.CursorShape.PointingHandCursor

    def __init__(
        self,
        stage: Stage,
        document: Document,
        hand: Callable[[], Hand],
        tell: Callable[[str], None],
        parent: QObject | None = None,
    ) -> None:
        """Move it by what `hand` makes; tell : shows the user a sentence."""
        super().__init__(stage, parent)
        self._document, self._make, self._tell = document, hand, tell
        self._hand: Hand | None = None

    def press(self, event: PointerEvent) -> None:
        """Show the surface under light, and begin."""
        self._hand = None
        document = self._document
        if document.mode is not Mode.LIT:
            if not document.offers(Mode.LIT):
                self._tell(self.tr("Synthesise first: light is shown on the finished surface."))
                return
            document.set_mode(Mode.LIT)
        if not document.lighting.lamps:
            self._tell(self.tr("There is no lamp to move; add one in the light panel."))
            return
        self._hand = self._make()
        self._hand.press(event)

    def drag(self, event: PointerEvent) -> None:
        """Move the lamp."""
        if self._hand is not None:
            self._hand.drag(event)

    def release(self, event: PointerEvent) -> None:
        """Leave it there."""
        hand, self._hand = self._hand, None
        if hand is not None:
            hand.release(event)

    def cancel(self) -> None:
        """Bring it back."""
        hand, self._hand = self._hand, None
        if hand is not None:
            hand.cancel()
