"""Settings: what is kept, what is refused, and where they are kept."""

import itertools
import math

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QByteArray, QSettings  # noqa: E402

from app.navigation import PRESETS, RULES  # noqa: E402
from app.pressure import FIRM, LINEAR, SOFT, Curve  # noqa: E402
from app.settings import NAMES, Settings, Values, read_values  # noqa: E402
from app.settings import RULES as RANGES  # noqa: E402
from app.store import SUFFIX, holds_code, open_store  # noqa: E402
from app.units import UNITS, length_text, parse_length  # noqa: E402
from btfcore.errors import InvalidParameter  # noqa: E402

OTHER = dict(
    undo_megabytes=300, threads=1, rate=1024, unit="mm", metres_per_unit=0.0254,
    navigation="blender", pivot="stroke", language="pt_BR", backend="software", theme="light",
    autosave_seconds=20, pressure=SOFT,
)  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "patina.ini"


@pytest.fixture
def settings(qtbot, path):
    return Settings(open_store(path).settings)


def again(settings, path):
    """The settings of the next start."""
    assert settings.saved()
    return Settings(open_store(path).settings)


# --- values


def test_all_settings_are_kept(settings, path):
    assert set(OTHER) == set(NAMES) == set(RANGES)
    settings.change(**OTHER)
    found = again(settings, path)
    assert found.values == Values(**OTHER) and found.notes == ()
    found.reset(["rate", "unit"])
    assert again(found, path).values == Values(**{**OTHER, "rate": 512, "unit": "model"})
    found.reset()
    assert again(found, path).values == Values()
    assert "settings" not in path.read_text()


def test_a_change_tells_what_it_changed(settings):
    heard = []
    settings.changed.connect(heard.append)
    settings.change(rate=1024, theme="dark", threads=0)
    settings.change(rate=1024)
    settings.reset()
    assert heard == [{"rate", "theme"}, {"rate", "theme"}]


WRONG = [
    ("undo_megabytes", 1), ("undo_megabytes", 10**9), ("undo_megabytes", 512.0),
    ("threads", -1), ("threads", 257), ("threads", True), ("rate", 15), ("rate", 10**30),
    ("unit", "inch"), ("metres_per_unit", 0.0), ("metres_per_unit", math.nan),
    ("metres_per_unit", math.inf), ("metres_per_unit", "1"), ("navigation", "zbrush"),
    ("pivot", ""), ("language", "../../etc"), ("language", "DE"), ("backend", "cuda"),
    ("theme", None), ("autosave_seconds", 9), ("pressure", "0,0;1,1"), ("nothing", 1),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_a_wrong_change_is_refused_and_changes_nothing(settings, path, name, value):
    heard = []
    settings.changed.connect(heard.append)
    with pytest.raises(InvalidParameter, match=name):
        settings.change(**{"theme": "dark", name: value})
    assert settings.values == Values() and heard == []
    assert again(settings, path).values == Values()


HOSTILE = ["", "x" * 100_000, "NaN", "-1e999", "1e400", "9" * 500, "\0\0", "☃", "@Invalid()"]


@pytest.mark.parametrize("text", HOSTILE)
def test_a_broken_store_falls_back_with_notes(text):
    values, notes = read_values(lambda name: text)
    assert values == Values()
    assert len(notes) == len(NAMES)
    for note, name in zip(notes, NAMES, strict=True):
        assert name in note and len(note) < 200


@pytest.mark.parametrize("value", [b"512", {"a": 1}, ["1", "2"], object(), 3.7])
def test_stored_values_of_odd_types_fall_back(value):
    values, notes = read_values(lambda name: value if name == "rate" else None)
    assert values == Values() and len(notes) == 1


def test_one_broken_value_spoils_no_other(settings, path):
    settings.change(**OTHER)
    assert settings.saved()
    lines = path.read_text().splitlines()
    path.write_text("\n".join("rate=-7" if x.startswith("rate") else x for x in lines))
    found = Settings(open_store(path).settings)
    assert found.values == Values(**{**OTHER, "rate": 512})
    assert len(found.notes) == 1 and "-7" in found.notes[0]


def test_a_curve_written_by_hand_without_quotes_is_read(path, qtbot):
    path.write_text("[settings]\npressure=0,0\n")
    found = Settings(open_store(path).settings)
    assert found.values.pressure == LINEAR and len(found.notes) == 1
    path.write_text('[settings]\npressure="0,0;0.5,0.25;1,1"\n')
    assert Settings(open_store(path).settings).values.pressure == FIRM


def test_two_windows_agree_after_a_reload(settings, path):
    other = Settings(open_store(path).settings)
    heard = []
    other.changed.connect(heard.append)
    settings.change(theme="light")
    assert settings.saved()
    other.reload()
    assert other.values.theme == "light" and heard == [{"theme"}]


def test_a_store_that_cannot_be_written_is_told(qtbot, tmp_path):
    (tmp_path / "file").write_text("")
    found = open_store(tmp_path / "file" / "patina.ini")
    settings = Settings(found.settings)
    settings.change(theme="dark")
    assert settings.values.theme == "dark" and not settings.saved()


def test_threads_are_never_more_than_cores(monkeypatch):
    monkeypatch.setattr("app.settings.threads", lambda: 4)
    assert [Values(threads=n).thread_count for n in (0, 1, 4, 200)] == [4, 1, 4, 4]


# --- the store


class _Run:
    def __reduce__(self):
        return (print, ("ran",))


@pytest.mark.parametrize("disguise", [False, True])
def test_a_store_with_a_pickle_is_set_aside_unread(qtbot, path, disguise, capsys):
    planted = QSettings(str(path), QSettings.Format.IniFormat)
    planted.setValue("settings/rate", _Run())
    planted.setValue("settings/theme", "dark")
    planted.sync()
    text = path.read_text(encoding="latin-1")
    assert "@Variant(" in text
    if disguise:  # Qt resolves escapes and joins quoted pieces
        text = text.replace("@Variant(", '\\x40Va"ri"an\\x74(').replace("PyQt_Py", "PyQt\\x5fPy")
        path.write_text(text, encoding="latin-1")
    del planted
    found = open_store(path)
    assert Settings(found.settings).values == Values()
    assert capsys.readouterr().out == ""
    assert len(found.notes) == 1 and str(path) in found.notes[0]
    assert path.with_name(path.name + SUFFIX).read_text(encoding="latin-1") == text
    assert open_store(path).notes == ()


def test_what_qt_itself_writes_is_no_code(qtbot, path):
    store = open_store(path).settings
    store.setValue("window/geometry", QByteArray(bytes(range(256)) * 4))
    store.setValue("recent", ["/a, b", '/"c"', "/ü@Home", "@home"])
    store.setValue("count", 3)
    store.sync()
    assert not holds_code(path.read_text(encoding="latin-1"))
    assert open_store(path).settings.value("recent") == ["/a, b", '/"c"', "/ü@Home", "@home"]


def test_a_refused_file_that_cannot_be_moved_stays_unread(qtbot, path, monkeypatch, tmp_path):
    def refuse(self, target):
        raise PermissionError("no")

    monkeypatch.setattr("pathlib.Path.replace", refuse)
    monkeypatch.setattr("app.store.mkdtemp", lambda prefix: str(tmp_path / "run"))
    text = "[settings]\ntheme=dark\nrate=@Variant(PyQt_PyObject)\n"
    path.write_text(text)
    found = open_store(path)
    settings = Settings(found.settings)
    assert len(found.notes) == 1 and settings.values == Values()
    settings.change(theme="light")
    assert settings.saved() and path.read_text() == text


def test_a_folder_or_a_huge_file_in_its_place_is_set_aside(qtbot, path, monkeypatch):
    monkeypatch.setattr("app.store.LARGEST", 100)
    path.write_text("[settings]\n" + "; long\n" * 50)
    assert len(open_store(path).notes) == 1 and not path.exists()
    path.mkdir()
    found = open_store(path)
    assert len(found.notes) == 1 and Settings(found.settings).saved()


# --- pressure


def test_a_pressure_curve_goes_through_its_points_and_never_falls():
    curves = [LINEAR, SOFT, FIRM, Curve(((0.1, 0.2), (0.3, 0.2), (0.35, 0.9), (0.9, 0.95)))]
    for curve in curves:
        for x, y in curve.points:
            assert curve(x) == pytest.approx(y)
        values = [curve(i / 500) for i in range(501)]
        assert all(a <= b + 1e-12 for a, b in itertools.pairwise(values))
        assert 0.0 <= values[0] <= values[-1] <= 1.0
        assert Curve.parse(curve.text()) == curve
    assert [LINEAR(each) for each in (-1.0, 0.25, 0.8, 2.0)] == pytest.approx([0, 0.25, 0.8, 1])
    assert LINEAR(math.nan) == 0.0
    assert SOFT(0.25) > LINEAR(0.25) > FIRM(0.25)


def test_the_pressure_curve_is_the_one_of_fritsch_and_carlson():
    scipy = pytest.importorskip("scipy.interpolate")
    curve = Curve(((0.0, 0.0), (0.5, 0.4), (1.0, 1.0)))
    slopes = [0.8, 1.0, 1.2]  # ends: the chord's; middle: mean of both; all inside the circle
    spline = scipy.CubicHermiteSpline([0.0, 0.5, 1.0], [0.0, 0.4, 1.0], slopes)
    for i in range(101):
        assert curve(i / 100) == pytest.approx(float(spline(i / 100)))


@pytest.mark.parametrize(
    "text",
    ["", "0,0", "0,0;0,1", "0,1;1,0", "0,0;1,2", "0,0;1,nan", "0,0;x,1", "0,0,0;1,1,1", "0;1",
     ";".join(f"{i / 20},{i / 20}" for i in range(13))],
)  # fmt: skip
def test_what_is_no_pressure_curve(text):
    with pytest.raises(InvalidParameter):
        Curve.parse(text)


# --- units


@pytest.mark.parametrize(
    ("length", "unit", "metres", "expected"),
    [
        (1.5, "model", 1.0, "1.5"),
        (1.5, "mm", 1.0, "1500 mm"),
        (2.0, "cm", 0.0254, "5.08 cm"),
        (0.123456, "m", 1.0, "0.1235 m"),
    ],
)
def test_lengths_are_shown_in_the_unit(length, unit, metres, expected):
    assert length_text(length, unit, metres) == expected


@pytest.mark.parametrize("unit", UNITS)
def test_a_shown_length_is_read_back(unit):
    for length in (0.0, 1.25, -3.5e-4, 42.0):
        text = length_text(length, unit, 0.01)
        assert parse_length(text, unit, 0.01) == pytest.approx(length)
    assert parse_length(" 1,5 cm", unit, 0.5) == pytest.approx(0.03)


@pytest.mark.parametrize("text", ["", "long", "1 inch", "nan", "inf", "1e999", "1 2", "1.2.3"])
def test_what_is_no_length(text):
    with pytest.raises(InvalidParameter):
        parse_length(text, "mm")


def test_all_drag_presets_can_be_chosen():
    assert set(RULES) == set(PRESETS)
