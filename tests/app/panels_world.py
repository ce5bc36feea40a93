"""A document whose layers obey at once: what the panels of the workspace are tested with."""

from dataclasses import replace

import numpy as np
from PyQt6.QtGui import QColor, QPalette

from app.layer_views import LayerView, PaintState
from app.settings import Settings
from app.store import open_store
from btfcore.paint.edits import Area, EraseEdit, PaintEdit, RepairEdit, RequiltEdit, StampEdit

EVERYWHERE = Area(everywhere=True)
MAKERS = {
    "paint": lambda **k: PaintEdit(area=EVERYWHERE, sample=1, **k),
    "stamp": lambda **k: StampEdit(point=(0.0, 0.0, 0.0), sample=1, **k),
    "erase": lambda **k: EraseEdit(area=EVERYWHERE, **k),
    "repair": lambda **k: RepairEdit(area=EVERYWHERE, **k),
    "requilt": lambda **k: RequiltEdit(area=EVERYWHERE, **k),
}


def layer(uid, kind="paint", name="", sample="rust", **more):
    """One layer as the document shows it."""
    return LayerView(
        uid, name or f"{kind} {uid}", kind, sample=sample if kind in ("paint", "stamp") else "",
        edit=MAKERS[kind](uid=uid), vertices=np.arange(5, dtype=np.int32), **more,
    )  # fmt: skip


class Verbs:
    """The verbs of the edits without any computing; `asked` is what was asked for."""

    def __init__(self, document):
        self.document, self.asked = document, []

    def put(self, layers, history=None, at=None):
        state = self.document.state
        self.document.set_state(
            PaintState(
                layers=tuple(layers), history=state.history if history is None else history,
                at=state.at if at is None else at,
            )
        )  # fmt: skip

    def _change(self, uid, change):
        layers = self.document.layers
        self.put(change(each) if each.uid == uid else each for each in layers)
        return True

    def show_layer(self, uid, visible):
        self.asked.append(("show", uid, visible))
        return self._change(uid, lambda each: replace(each, visible=visible))

    def rename_layer(self, uid, name):
        self.asked.append(("rename", uid, name))
        return self._change(uid, lambda each: replace(each, name=name))

    def change_layer(self, uid, **knobs):
        self.asked.append(("change", uid, knobs))
        return self._change(uid, lambda each: replace(each, edit=replace(each.edit, **knobs)))

    def remove_layer(self, uid):
        self.asked.append(("remove", uid))
        self.put(each for each in self.document.layers if each.uid != uid)
        return True

    def duplicate_layer(self, uid):
        self.asked.append(("duplicate", uid))
        layers = list(self.document.layers)
        place = next(at for at, each in enumerate(layers) if each.uid == uid)
        fresh = max(each.uid for each in layers) + 1
        layers.insert(place + 1, replace(layers[place], uid=fresh, name=f"{uid} again"))
        self.put(layers)
        return True

    def move_layer(self, uid, place):
        self.asked.append(("move", uid, place))
        layers = [each for each in self.document.layers if each.uid != uid]
        moved = next(each for each in self.document.layers if each.uid == uid)
        self.put([*layers[:place], moved, *layers[place:]])
        return True

    def undo_to(self, step):
        self.asked.append(("undo_to", step))
        self.put(self.document.layers, at=step)
        return True


def uids(document):
    """The layers of a document, bottom first."""
    return [each.uid for each in document.layers]


def settings(folder):
    """Settings in a file of their own."""
    return Settings(open_store(folder / "patina.ini").settings)


def light_palette():
    """The colours of a light desktop."""
    palette, role = QPalette(), QPalette.ColorRole
    for each, colour in (
        (role.Window, "#efefef"), (role.WindowText, "#202020"), (role.Base, "#ffffff"),
        (role.AlternateBase, "#f5f5f5"), (role.Text, "#202020"), (role.Button, "#e8e8e8"),
        (role.ButtonText, "#202020"), (role.Midlight, "#e3e6ea"), (role.Mid, "#b5b9be"),
        (role.Highlight, "#c8752a"), (role.HighlightedText, "#ffffff"),
    ):  # fmt: skip
        palette.setColor(each, QColor(colour))
    return palette
