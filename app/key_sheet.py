"""The sheet of all keys as Markdown: `python -m app.key_sheet > docs/keys.md` writes the docs'."""

from __future__ import annotations

import sys
from collections.abc import Callable

from PyQt6.QtCore import QT_TRANSLATE_NOOP, QCoreApplication, Qt

from app.key_table import COMMANDS, GROUPS, KEY_PRESETS, Command, default_keys
from app.keys import Keymap, name
from app.navigation import PRESETS, RULES, Rule, Verb

translate = QCoreApplication.translate
TITLES = {
    "patina": "Patina", "blender": "Blender", "maya": "Maya", "pen": "Pen", "trackpad": "Trackpad",
}  # fmt: skip
VERBS = {
    Verb.ORBIT: QT_TRANSLATE_NOOP("Keys", "Orbit"),
    Verb.PAN: QT_TRANSLATE_NOOP("Keys", "Pan"),
    Verb.ZOOM: QT_TRANSLATE_NOOP("Keys", "Zoom"),
    Verb.DOLLY: QT_TRANSLATE_NOOP("Keys", "Dolly"),
}
_BUTTONS = {
    Qt.MouseButton.LeftButton: QT_TRANSLATE_NOOP("Keys", "left"),
    Qt.MouseButton.MiddleButton: QT_TRANSLATE_NOOP("Keys", "middle"),
    Qt.MouseButton.RightButton: QT_TRANSLATE_NOOP("Keys", "right"),
}
_MODIFIERS = {
    Qt.KeyboardModifier.ControlModifier: "Ctrl",
    Qt.KeyboardModifier.AltModifier: "Alt",
    Qt.KeyboardModifier.ShiftModifier: "Shift",
}


def cheat_sheet(keymap: Keymap, navigation: str) -> str:
    """Markdown of the keys in force and of the drags of one of `PRESETS`."""
    title = translate("Keys", "Keys")
    sheet = [f"# {title}\n"]
    sheet += _key_tables([translate("Keys", "Key")], lambda each: [keymap.keys(each.id)])
    sheet += _drag_table((navigation,))
    return "\n".join(sheet)


def presets_sheet() -> str:
    """Markdown of the keys and drags of all presets, as in docs/keys.md."""
    sheet = [
        "# Keys\n",
        "One page of all keys and drags as they are at first. The keys are chosen and changed under"
        "\nEdit → Keyboard shortcuts, the drags under Edit → Settings → View. On a Mac, Ctrl is"
        "\nCommand. “Num” is the keypad. This page is made by `python -m app.key_sheet`.\n",
    ]
    sheet += _key_tables(
        [TITLES[each] for each in KEY_PRESETS],
        lambda each: [default_keys(preset, each.id) for preset in KEY_PRESETS],
    )
    sheet += _drag_table(PRESETS)
    return "\n".join(sheet)


def _key_tables(columns: list[str], keys: Callable[[Command], list[tuple[str, ...]]]) -> list[str]:
    lines = []
    for group, title in GROUPS.items():
        lines += [
            f"## {_tr(title)}\n",
            _row([translate("Keys", "Command"), *columns]),
            _rule(1 + len(columns)),
        ]
        for each in COMMANDS:
            if each.group == group:
                lines.append(_row([name(each.id), *(_caps(found) for found in keys(each))]))
        lines.append("")
    return lines


def _drag_table(presets: tuple[str, ...]) -> list[str]:
    lines = [
        f"## {translate('Keys', 'Drags in the view')}\n",
        translate("Keys", "Drags with a star are the camera's only where no tool takes them."),
        "",
        _row(["", *(TITLES[each] for each in presets)]),
        _rule(1 + len(presets)),
    ]
    for verb, title in VERBS.items():
        cells = [
            ", ".join(_drag(rule) for rule in RULES[preset] if rule.verb is verb) or "–"
            for preset in presets
        ]
        lines.append(_row([_tr(title), *cells]))
    lines += [
        "",
        translate(
            "Keys",
            "The wheel zooms; with the stamp it turns the stamp, and Alt and the wheel zoom. On a"
            " touchpad two fingers scroll like the wheel; with the presets Blender and Trackpad"
            " they orbit, pan with Shift and zoom with Ctrl.",
        ),
        "",
    ]
    return lines


def _drag(rule: Rule) -> str:
    parts = [text for flag, text in _MODIFIERS.items() if rule.modifiers & flag]
    if rule.held is Qt.Key.Key_Space:
        parts.append(translate("Keys", "Space"))
    return "+".join([*parts, _tr(_BUTTONS[rule.button])]) + ("\\*" if rule.free else "")


def _caps(keys: tuple[str, ...]) -> str:
    keys = tuple(key.replace("|", "\\|").replace("`", "``` ` ```") for key in keys)
    return ", ".join(f"`{key}`" for key in keys) or "–"


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _rule(columns: int) -> str:
    return "|" + " --- |" * columns


def _tr(text: str) -> str:
    return translate("Keys", text)


if __name__ == "__main__":
    sys.stdout.write(presets_sheet())
