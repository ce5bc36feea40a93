"""What the user may set for good: typed values with ranges, kept in the store."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from PyQt6.QtCore import QCoreApplication, QObject, QSettings, pyqtSignal

from app.backend import KINDS
from app.navigation import PRESETS
from app.pressure import LINEAR, Curve
from app.units import UNITS
from btfcore.errors import InvalidParameter
from btfcore.pipeline import LARGEST_RATE, SMALLEST_RATE
from btfcore.render.pool import threads

translate = QCoreApplication.translate
GROUP = "settings"
THEMES = ("system", "light", "dark")
PIVOTS = ("view", "stroke")
AT_START = frozenset({"threads", "language", "backend"})  # read once, when the program starts

_LONGEST = 400  # characters of a stored value


@dataclass(frozen=True)
class Rule:
    """How one value is read from text and what it may be.

    kind : of Python; low, high : both allowed; choices : all that are allowed, if any; also :
    a value outside the range that is allowed as well.
    """

    kind: type
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    pattern: str = ""
    also: float | None = None

    def parse(self, text: str) -> Any:
        """Value of a text; raises `InvalidParameter` or ValueError."""
        return Curve.parse(text) if self.kind is Curve else self.kind(text)

    def complaint(self, value: object) -> str:
        """What is wrong with a value, as "is …", or ""."""
        right = isinstance(value, (int, float) if self.kind is float else self.kind)
        if not right or isinstance(value, bool):
            return f"is {str(value)[:40]!r}, no {self.kind.__name__}"
        if isinstance(value, (int, float)):
            if not (self.low <= value <= self.high or value == self.also):  # NaN too
                return f"is {value}, outside {self.low:g} … {self.high:g}"
        elif isinstance(value, str):
            if self.choices and value not in self.choices:
                return f"is {value[:40]!r}; it can be {', '.join(self.choices)}"
            if self.pattern and not re.fullmatch(self.pattern, value):
                return f"is {value[:40]!r}"
        return ""


RULES: Mapping[str, Rule] = {
    "undo_megabytes": Rule(int, 64, 65_536),
    "threads": Rule(int, 1, 256, also=0),
    "rate": Rule(int, SMALLEST_RATE, LARGEST_RATE),
    "unit": Rule(str, choices=UNITS),
    "metres_per_unit": Rule(float, 1e-6, 1e6),
    "navigation": Rule(str, choices=PRESETS),
    "pivot": Rule(str, choices=PIVOTS),
    "language": Rule(str, pattern=r"system|[a-z]{2,3}(_[A-Z]{2})?"),
    "backend": Rule(str, choices=KINDS),
    "theme": Rule(str, choices=THEMES),
    "autosave_seconds": Rule(int, 10, 3600),
    "pressure": Rule(Curve),
}


@dataclass(frozen=True)
class Values:
    """All settings; the defaults are those of a new user.

    undo_megabytes : memory that undo may hold, in MiB. threads : for computing; 0: one for each
    core. rate : side of the atlas of a new mesh in texels. unit : "model", "mm", "cm", "m";
    metres_per_unit : how long one unit of the mesh is. navigation : preset of the mouse; pivot :
    what orbiting turns round, the middle of the "view" or the last "stroke". language : "system"
    or a code like "de" or "pt_BR". backend : "auto", "shader", "software". theme : "system",
    "light", "dark". autosave_seconds : between two automatic saves. pressure : of the pen.
    Raises `InvalidParameter` for values outside `RULES`.
    """

    undo_megabytes: int = 1024
    threads: int = 0
    rate: int = 512
    unit: str = "model"
    metres_per_unit: float = 1.0
    navigation: str = "patina"
    pivot: str = "view"
    language: str = "system"
    backend: str = "auto"
    theme: str = "system"
    autosave_seconds: int = 45
    pressure: Curve = LINEAR

    def __post_init__(self) -> None:  # noqa: D105
        for name, rule in RULES.items():
            wrong = rule.complaint(getattr(self, name))
            if wrong:
                raise InvalidParameter(f"the setting {name} {wrong}")

    @property
    def thread_count(self) -> int:
        """Threads to compute with: what was set, never more than there are cores."""
        cores = threads()
        return min(self.threads, cores) if self.threads else cores


NAMES = tuple(each.name for each in fields(Values))


class Settings(QObject):
    """The settings in force; every change is stored at once.

    changed(names) tells which, a frozenset of names of `Values`. `notes` are sentences about
    stored values that could not be used.
    """

    changed = pyqtSignal(object)

    def __init__(self, store: QSettings, parent: QObject | None = None) -> None:
        """Read `store`; what is broken there counts as not set, and is noted."""
        super().__init__(parent)
        self._store = store
        self.values, self.notes = read_values(_reader(store))

    def change(self, **knobs: Any) -> None:
        """Set some values; raises `InvalidParameter`, and then nothing has changed."""
        unknown = set(knobs) - set(NAMES)
        if unknown:
            raise InvalidParameter(f"there is no setting {sorted(unknown)[0][:40]!r}")
        self._take(replace(self.values, **knobs))

    def reset(self, names: Iterable[str] = NAMES) -> None:
        """Set some values, or all, as they were at first."""
        fresh = Values()
        self.change(**{name: getattr(fresh, name) for name in names})

    def reload(self) -> None:
        """Read the store again: another window of Patina may have changed it."""
        self._store.sync()
        values, self.notes = read_values(_reader(self._store))
        self._tell(values)

    def saved(self) -> bool:
        """Write now; whether the store could be written."""
        self._store.sync()
        return self._store.status() == QSettings.Status.NoError

    def _take(self, values: Values) -> None:
        fresh = Values()
        for name in NAMES:
            value, key = getattr(values, name), f"{GROUP}/{name}"
            if value == getattr(fresh, name):  # so that a better default reaches old users
                self._store.remove(key)
            elif value != getattr(self.values, name):
                self._store.setValue(key, value.text() if isinstance(value, Curve) else str(value))
        self._tell(values)

    def _tell(self, values: Values) -> None:
        before, self.values = self.values, values
        names = frozenset(n for n in NAMES if getattr(before, n) != getattr(values, n))
        if names:
            self.changed.emit(names)


def read_values(read: Callable[[str], object]) -> tuple[Values, tuple[str, ...]]:
    """Values from a store, and a sentence for each stored one that cannot be used.

    read : stored value of a name, None where there is none. Raises nothing.
    """
    found: dict[str, Any] = {}
    notes = []
    for name, rule in RULES.items():
        stored = read(name)
        if stored is None:
            continue
        try:
            if not isinstance(stored, (str, int, float)) or len(str(stored)) > _LONGEST:
                raise InvalidParameter(f"the setting {name} holds {type(stored).__name__}")
            value = rule.parse(str(stored).strip())
            wrong = rule.complaint(value)
        except (InvalidParameter, ValueError, OverflowError):
            value, wrong = None, f"is {str(stored)[:40]!r}"
        if wrong:
            text = translate("Settings", "The stored setting {0} {1}; its default is used.")
            notes.append(text.format(name, wrong))
        else:
            found[name] = value
    return Values(**found), tuple(notes)


def _reader(store: QSettings) -> Callable[[str], object]:
    def read(name: str) -> object:
        value = store.value(f"{GROUP}/{name}")
        # Qt splits at commas, and a curve has some if the file was written by hand
        return ",".join(map(str, value)) if isinstance(value, list) else value

    return read
