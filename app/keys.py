"""The keys in force: a preset and the user's changes to it, live in every action bound to it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from PyQt6 import sip
from PyQt6.QtCore import QCoreApplication, QObject, QSettings, Qt, pyqtSignal
from PyQt6.QtGui import QAction, QKeySequence
from PyQt6.QtWidgets import QWidget

from app.key_table import BY_ID, COMMANDS, KEY_PRESETS, default_keys
from btfcore.errors import InvalidParameter

translate = QCoreApplication.translate
GROUP = "keys"
MOST_KEYS = 4  # for one command
_BETWEEN = " | "
_PORTABLE = QKeySequence.SequenceFormat.PortableText
_NATIVE = QKeySequence.SequenceFormat.NativeText
_SHIFT, _CTRL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier

# What Shift makes of a key of the US layout: "Shift+[" and "{" are one key there.
_SHIFTED = dict(zip("`1234567890-=[]\\;',./", '~!@#$%^&*()_+{}|:"<>?', strict=True))
_US = {ord(plain): ord(shifted) for plain, shifted in _SHIFTED.items()}


class KeyTaken(InvalidParameter):
    """A key belongs to other commands already: `owners` are their ids."""

    def __init__(self, text: str, owners: tuple[str, ...]) -> None:
        """Say it in `text`."""
        super().__init__(text)
        self.owners = owners


class Keymap(QObject):
    """Which keys each command has.

    No two commands ever have one key, nor one key and the beginning of another's: Qt would run
    neither. The user's changes are stored for each preset by itself, so trying another preset
    loses none. `notes` are sentences about stored keys that could not be used.
    """

    changed = pyqtSignal()

    def __init__(self, store: QSettings, parent: QObject | None = None) -> None:
        """Read `store`; what is broken there counts as not set, and is noted."""
        super().__init__(parent)
        self._store = store
        self.notes: tuple[str, ...] = ()
        self._bound: list[tuple[QAction | QWidget, str, str]] = []
        preset = store.value(f"{GROUP}/preset", KEY_PRESETS[0])
        self.preset = KEY_PRESETS[0]
        if preset in KEY_PRESETS:
            self.preset = str(preset)
        else:
            self.notes = (
                translate("Keys", "There is no key preset {0}.").format(str(preset)[:40]),
            )
        self._read()

    # --- what there is

    def keys(self, command: str) -> tuple[str, ...]:
        """Keys of a command as portable text; raises `InvalidParameter` for an unknown one."""
        return self._keys[_known(command)]

    def shown(self, command: str) -> str:
        """Keys of a command as this system writes them, or ""."""
        return " / ".join(QKeySequence(key).toString(_NATIVE) for key in self.keys(command))

    def is_changed(self, command: str) -> bool:
        """Whether the user gave a command other keys than the preset does."""
        return self.keys(command) != _normal(default_keys(self.preset, command))

    def owners(self, key: str, *, beside: str = "") -> tuple[str, ...]:
        """Commands that `key` would clash with, all but `beside`."""
        return tuple(
            each.id
            for each in COMMANDS
            if each.id != beside and any(clash(key, other) for other in self._keys[each.id])
        )

    # --- changes

    def assign(self, command: str, keys: Iterable[str], *, take: bool = False) -> None:
        """Give a command these keys and no others; they are stored.

        take : take them from other commands. Raises `KeyTaken` where others have them and `take`
        is False; `InvalidParameter` for what is no key, is used by drags in the view, or for
        more than `MOST_KEYS`. Then nothing has changed.
        """
        wanted = _normal(keys)
        if len(wanted) > MOST_KEYS:
            raise InvalidParameter(f"{len(wanted)} keys for {command}, more than {MOST_KEYS}")
        _known(command)
        for key in wanted:
            found = self.owners(key, beside=command)
            if found and not take:
                names = ", ".join(name(each) for each in found)
                raise KeyTaken(
                    translate("Keys", "{0} is the key of: {1}").format(
                        QKeySequence(key).toString(_NATIVE), names
                    ),
                    found,
                )
        self._set(command, wanted)
        self._finish()

    def reset(self, command: str) -> None:
        """Give a command the keys of the preset, taking them from others."""
        self._set(_known(command), _normal(default_keys(self.preset, command)))
        self._finish()

    def reset_all(self) -> None:
        """Forget all of the user's changes to this preset."""
        self._store.remove(f"{GROUP}/{self.preset}")
        self._read()
        self._finish()

    def set_preset(self, preset: str) -> None:
        """Take another preset and the user's changes to that."""
        if preset not in KEY_PRESETS:
            raise InvalidParameter(
                f"there is no key preset {preset[:40]!r}, only {', '.join(KEY_PRESETS)}"
            )
        self.preset = preset
        self._store.setValue(f"{GROUP}/preset", preset)
        self._read()
        self._finish()

    # --- actions and buttons

    def bind(self, action: QAction, command: str) -> QAction:
        """Let an action have the keys of a command, now and after changes; returns the action.

        An action without a text gets the command's name. The tooltip tells the keys. The action
        of a command that is `in_view` must be added to the view's widget, and not to the window.
        """
        if BY_ID[_known(command)].in_view:
            action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        if not action.text():
            action.setText(name(command))
        self._follow(action, command)
        return action

    def tell(self, widget: QWidget, command: str) -> None:
        """Let the tooltip of a button or other widget tell the keys of a command."""
        self._follow(widget, _known(command))

    def bound(self) -> frozenset[str]:
        """Commands that a living action or widget has."""
        return frozenset(command for each, command, _ in self._bound if not sip.isdeleted(each))

    def actions(self, key: str) -> list[QAction]:
        """Living actions that are bound to the command of a key."""
        return [
            each
            for each, command, _ in self._bound
            if not sip.isdeleted(each)
            and isinstance(each, QAction)
            and any(clash(key, other) for other in self._keys[command])
        ]

    def _follow(self, target: QAction | QWidget, command: str) -> None:
        self._bound = [
            each for each in self._bound if not sip.isdeleted(each[0]) and each[0] is not target
        ]
        entry = (target, command, target.toolTip() or name(command))
        self._bound.append(entry)
        self._apply(*entry)

    def _apply(self, target: QAction | QWidget, command: str, tip: str) -> None:
        if isinstance(target, QAction):
            target.setShortcuts([QKeySequence(key) for key in self._keys[command]])
        shown = self.shown(command)
        target.setToolTip(f"{tip} ({shown})" if shown else tip)

    # --- inside

    def _set(self, command: str, wanted: tuple[str, ...]) -> None:
        for key in wanted:
            for each in self.owners(key, beside=command):
                rest = tuple(other for other in self._keys[each] if not clash(key, other))
                self._put(each, rest)
        self._put(command, wanted)

    def _put(self, command: str, keys: tuple[str, ...]) -> None:
        place = f"{GROUP}/{self.preset}/{command}"
        self._keys[command] = keys
        if keys == _normal(default_keys(self.preset, command)):
            self._store.remove(place)
        else:
            self._store.setValue(place, _BETWEEN.join(keys))

    def _read(self) -> None:
        """Keys of the preset, and over them what is stored: there the user's choice wins."""
        preset = {each.id: _normal(default_keys(self.preset, each.id)) for each in COMMANDS}
        own: dict[str, tuple[str, ...]] = {}
        for each in COMMANDS:
            stored = self._store.value(f"{GROUP}/{self.preset}/{each.id}")
            if stored is None:
                continue
            try:
                own[each.id] = self._usable(stored, own)
            except InvalidParameter as error:
                text = translate("Keys", "The stored keys of “{0}” are not used: {1}")
                self.notes += (text.format(name(each.id), error),)
        taken = [key for keys in own.values() for key in keys]
        self._keys = {
            command: own.get(
                command, tuple(k for k in keys if not any(clash(k, each) for each in taken))
            )
            for command, keys in preset.items()
        }

    def _usable(self, stored: object, own: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
        if isinstance(stored, list):  # Qt splits at commas
            stored = ",".join(map(str, stored))
        if not isinstance(stored, str) or len(stored) > 200:
            raise InvalidParameter(f"they are {str(stored)[:40]!r}")
        keys = _normal(stored.split(_BETWEEN) if stored else ())
        for key in keys[MOST_KEYS:]:
            raise InvalidParameter(f"{key} is one too many")
        for key in keys:
            for each, others in own.items():
                if any(clash(key, other) for other in others):
                    raise InvalidParameter(f"{key} is the key of {name(each)}")
        return keys

    def _finish(self) -> None:
        self._bound = [each for each in self._bound if not sip.isdeleted(each[0])]
        for each in self._bound:
            self._apply(*each)
        self.changed.emit()


def name(command: str) -> str:
    """Name of a command in the user's language."""
    return translate("Keys", BY_ID[_known(command)].name)


def normal_key(text: str) -> str:
    """Portable text of a key; raises `InvalidParameter` for no key or one that drags use."""
    sequence = QKeySequence(text[:80], _PORTABLE)
    portable = sequence.toString(_PORTABLE)
    parts = [sequence[i] for i in range(sequence.count())]
    if not portable or any(each.key() == Qt.Key.Key_unknown for each in parts):
        raise InvalidParameter(f"{text[:40]!r} is no key")
    first = parts[0]
    if first.key() == Qt.Key.Key_Space and not first.keyboardModifiers() & ~(_SHIFT | _CTRL):
        raise InvalidParameter(
            translate("Keys", "{0} moves the view while it is held").format(portable)
        )
    return portable


def clash(one: str, other: str) -> bool:
    """Whether two keys are alike, or one begins with the other."""
    first, second = _strokes(one), _strokes(other)
    shorter = min(len(first), len(second))
    return shorter > 0 and first[:shorter] == second[:shorter]


@lru_cache(1024)
def _strokes(key: str) -> tuple[tuple[Qt.KeyboardModifier, int], ...]:
    """Modifiers and key of each stroke, the same for all ways to write it on a US layout."""
    sequence = QKeySequence(key, _PORTABLE)
    found = []
    for i in range(sequence.count()):
        modifiers, code = sequence[i].keyboardModifiers(), int(sequence[i].key())
        keypad = bool(modifiers & Qt.KeyboardModifier.KeypadModifier)
        if modifiers & _SHIFT and not keypad and (code in _US or code in _US.values()):
            modifiers, code = modifiers & ~_SHIFT, _US.get(code, code)
        found.append((modifiers, code))
    return tuple(found)


def _normal(keys: Iterable[str]) -> tuple[str, ...]:
    """Portable text of keys, each once."""
    found: list[str] = []
    for key in map(normal_key, keys):
        if not any(clash(key, each) for each in found):
            found.append(key)
    return tuple(found)


def _known(command: str) -> str:
    if command not in BY_ID:
        raise InvalidParameter(f"there is no command {command[:40]!r}")
    return command
