"""Where the application remembers: one INI file, which is looked through before Qt reads it.

PyQt unpickles what an INI file holds as `@Variant(… PyQt_PyObject …)`, so a file from somebody
else could run code. Patina writes text, numbers, lists of text and QByteArray; PyQt would pickle
a tuple or Python's own bytes. A file that holds a pickle is set aside.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp

from PyQt6.QtCore import QCoreApplication, QSettings, QStandardPaths

translate = QCoreApplication.translate
LARGEST = 4 * 1024 * 1024  # bytes; ours has a few thousand
SUFFIX = ".refused"

_HEX = re.compile(r"\\x([0-9a-fA-F]+)")
_OCTAL = re.compile(r"\\([0-7]+)")
_FILLING = re.compile(r'[\s"\\]+')
_REFUSED = ("@Variant", "PyQt_PyObject")


@dataclass(frozen=True)
class Store:
    """An opened store, and sentences for the user about what was wrong with its file."""

    settings: QSettings
    notes: tuple[str, ...] = ()


def default_path() -> Path:
    """Where this user's file lies."""
    place = QStandardPaths.StandardLocation.GenericConfigLocation
    return Path(QStandardPaths.writableLocation(place)) / "Patina" / "patina.ini"


def open_store(path: Path | None = None) -> Store:
    """Open the file at `path` (None: this user's own), made on the first change.

    A file that holds pickled values, is larger than `LARGEST` or cannot be read is renamed to
    end with `SUFFIX`, and everything starts from its defaults; a note tells so. Raises nothing.
    """
    place = default_path() if path is None else path
    notes: tuple[str, ...] = ()
    reason = _unsafe(place)
    if reason:
        notes = (_set_aside(place, reason),)
    settings = QSettings(str(_free(place)), QSettings.Format.IniFormat)
    settings.setFallbacksEnabled(False)
    return Store(settings, notes)


def holds_code(text: str) -> bool:
    """Whether the text of an INI file holds a value that Qt would unpickle.

    Qt joins quoted pieces and resolves escapes before it looks, so this does too.
    """
    plain = _HEX.sub(_character(16), text)
    plain = _OCTAL.sub(_character(8), plain)
    plain = _FILLING.sub("", plain)
    return any(each in plain for each in _REFUSED)


def _character(base: int) -> Callable[[re.Match[str]], str]:
    return lambda found: chr(int(found[1][-6:], base) & 0xFF)


def _unsafe(path: Path) -> str:
    """Why a file must not be read, or ""."""
    try:
        if not path.exists():
            return ""
        size = path.stat().st_size
        if not path.is_file() or size > LARGEST:
            return translate("Store", "it has {0} bytes, more than {1}").format(size, LARGEST)
        text = path.read_bytes().decode("latin-1")
    except OSError as error:
        return str(error.strerror or error)
    return (
        translate("Store", "it holds a value that could run a program") if holds_code(text) else ""
    )


def _set_aside(path: Path, reason: str) -> str:
    try:
        path.replace(path.with_name(path.name + SUFFIX))
    except OSError:
        return translate(
            "Store", "The settings in {0} were not read: {1}. Nothing is remembered."
        ).format(path, reason)
    return translate(
        "Store", "The settings in {0} were set aside: {1}. All settings are as new."
    ).format(path, reason)


def _free(path: Path) -> Path:
    """Return `path`, or a place of this run alone where a refused file could not be moved."""
    return Path(mkdtemp(prefix="patina-")) / path.name if _unsafe(path) else path
