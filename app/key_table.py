"""Every command of the application, and its keys in each preset: the table that all else reads.

Keys are Qt's portable text ("Ctrl+Shift+Z"; Ctrl is Command on a Mac; "Num+1" is the keypad's 1).
"""

from __future__ import annotations

from dataclasses import dataclass

from PyQt6.QtCore import QT_TRANSLATE_NOOP

KEY_PRESETS = ("patina", "blender", "maya")


@dataclass(frozen=True)
class Command:
    """Something that the user can ask for by a key.

    name : in English, of the translation context "Keys". keys : of the preset "patina", the
    first is shown first. in_view : only while the view of the surface has the keyboard, because
    elsewhere the key has a use of its own.
    """

    id: str
    name: str
    keys: tuple[str, ...] = ()
    in_view: bool = False

    @property
    def group(self) -> str:
        """Which of `GROUPS` it belongs to."""
        return self.id.split(".")[0]


GROUPS = {
    "file": QT_TRANSLATE_NOOP("Keys", "File"),
    "edit": QT_TRANSLATE_NOOP("Keys", "Edit"),
    "tool": QT_TRANSLATE_NOOP("Keys", "Tools"),
    "brush": QT_TRANSLATE_NOOP("Keys", "Brush and stamp"),
    "run": QT_TRANSLATE_NOOP("Keys", "Synthesis"),
    "mode": QT_TRANSLATE_NOOP("Keys", "What is shown"),
    "view": QT_TRANSLATE_NOOP("Keys", "View"),
    "help": QT_TRANSLATE_NOOP("Keys", "Help"),
}

# fmt: off
COMMANDS = (
    Command("file.open", QT_TRANSLATE_NOOP("Keys", "Open mesh or project"), ("Ctrl+O",)),
    Command("file.sample", QT_TRANSLATE_NOOP("Keys", "Open sample"), ("Ctrl+I",)),
    Command("file.folder", QT_TRANSLATE_NOOP("Keys", "Open folder of samples"), ("Ctrl+Shift+O",)),
    Command("file.save", QT_TRANSLATE_NOOP("Keys", "Save"), ("Ctrl+S",)),
    Command("file.save_as", QT_TRANSLATE_NOOP("Keys", "Save as"), ("Ctrl+Shift+S",)),
    Command("file.export", QT_TRANSLATE_NOOP("Keys", "Export"), ("Ctrl+E",)),
    Command("file.window", QT_TRANSLATE_NOOP("Keys", "New window"), ("Ctrl+Shift+N",)),
    Command("file.quit", QT_TRANSLATE_NOOP("Keys", "Quit"), ("Ctrl+Q",)),
    Command("edit.undo", QT_TRANSLATE_NOOP("Keys", "Undo"), ("Ctrl+Z",)),
    Command("edit.redo", QT_TRANSLATE_NOOP("Keys", "Redo"), ("Ctrl+Shift+Z", "Ctrl+Y")),
    Command("edit.duplicate", QT_TRANSLATE_NOOP("Keys", "Duplicate layer"), ("Ctrl+D",)),
    Command("edit.rename", QT_TRANSLATE_NOOP("Keys", "Rename layer"), ("F2",)),
    Command("edit.delete", QT_TRANSLATE_NOOP("Keys", "Delete layer"), ("Del",)),
    Command("edit.settings", QT_TRANSLATE_NOOP("Keys", "Settings"), ("Ctrl+,",)),
    Command("edit.keys", QT_TRANSLATE_NOOP("Keys", "Keyboard shortcuts"), ("Ctrl+Alt+K",)),
    Command("tool.navigate", QT_TRANSLATE_NOOP("Keys", "No tool: drags move the view"), ("V",)),
    Command("tool.orient", QT_TRANSLATE_NOOP("Keys", "Orient the pattern"), ("O",)),
    Command("tool.brush", QT_TRANSLATE_NOOP("Keys", "Paint a feature"), ("B",)),
    Command("tool.stamp", QT_TRANSLATE_NOOP("Keys", "Stamp"), ("S",)),
    Command("tool.erase", QT_TRANSLATE_NOOP("Keys", "Erase"), ("E",)),
    Command("tool.repair", QT_TRANSLATE_NOOP("Keys", "Repair"), ("R",)),
    Command("tool.mask", QT_TRANSLATE_NOOP("Keys", "Mask and protect"), ("M",)),
    Command("tool.light", QT_TRANSLATE_NOOP("Keys", "Light: drags move the lamp"), ("L",)),
    Command("tool.pick", QT_TRANSLATE_NOOP("Keys", "Pick the sample from the surface"), ("I",)),
    Command("tool.measure", QT_TRANSLATE_NOOP("Keys", "Measure"), ("U",)),
    Command("brush.smaller", QT_TRANSLATE_NOOP("Keys", "Smaller"), ("[",)),
    Command("brush.larger", QT_TRANSLATE_NOOP("Keys", "Larger"), ("]",)),
    Command("brush.softer", QT_TRANSLATE_NOOP("Keys", "Softer"), ("Shift+[",)),
    Command("brush.harder", QT_TRANSLATE_NOOP("Keys", "Harder"), ("Shift+]",)),
    Command("brush.size", QT_TRANSLATE_NOOP("Keys", "Set the size by moving the pointer"), ("D",)),
    Command("brush.hardness",
            QT_TRANSLATE_NOOP("Keys", "Set the hardness by moving the pointer"), ("Shift+D",)),
    Command("brush.turn_left", QT_TRANSLATE_NOOP("Keys", "Turn the stamp left"), (",",)),
    Command("brush.turn_right", QT_TRANSLATE_NOOP("Keys", "Turn the stamp right"), (".",)),
    Command("brush.switch", QT_TRANSLATE_NOOP("Keys", "Exchange adding and removing"), ("X",)),
    Command("brush.symmetry_x", QT_TRANSLATE_NOOP("Keys", "Symmetry across X"), ("Shift+X",)),
    Command("brush.symmetry_y", QT_TRANSLATE_NOOP("Keys", "Symmetry across Y"), ("Shift+Y",)),
    Command("brush.symmetry_z", QT_TRANSLATE_NOOP("Keys", "Symmetry across Z"), ("Shift+Z",)),
    Command("run.synthesize", QT_TRANSLATE_NOOP("Keys", "Synthesize"), ("Ctrl+R",)),
    Command("run.pause", QT_TRANSLATE_NOOP("Keys", "Pause"), ("Ctrl+P",)),
    Command("run.cancel", QT_TRANSLATE_NOOP("Keys", "Cancel a stroke or what runs"), ("Esc",)),
    Command("mode.colour", QT_TRANSLATE_NOOP("Keys", "Colour"), ("1",)),
    Command("mode.seams", QT_TRANSLATE_NOOP("Keys", "Seams"), ("2",)),
    Command("mode.charts", QT_TRANSLATE_NOOP("Keys", "Charts"), ("3",)),
    Command("mode.field", QT_TRANSLATE_NOOP("Keys", "Field"), ("4",)),
    Command("mode.lit", QT_TRANSLATE_NOOP("Keys", "Under light"), ("5",)),
    Command("mode.distortion", QT_TRANSLATE_NOOP("Keys", "Distortion"), ("6",)),
    Command("mode.constraint", QT_TRANSLATE_NOOP("Keys", "Constraint"), ("7",)),
    Command("mode.error", QT_TRANSLATE_NOOP("Keys", "Error"), ("8",)),
    Command("mode.split", QT_TRANSLATE_NOOP("Keys", "Before and after, split"), ("9",)),
    Command("view.frame_all", QT_TRANSLATE_NOOP("Keys", "Frame everything"), ("F", "Home")),
    Command("view.frame_selected", QT_TRANSLATE_NOOP("Keys", "Frame what is selected"),
            ("Shift+F", "Num+.")),
    Command("view.pivot_stroke", QT_TRANSLATE_NOOP("Keys", "Orbit round the last stroke"), ("P",)),
    Command("view.zoom_in", QT_TRANSLATE_NOOP("Keys", "Nearer"), ("=", "Num++")),
    Command("view.zoom_out", QT_TRANSLATE_NOOP("Keys", "Farther"), ("-", "Num+-")),
    Command("view.turn_left", QT_TRANSLATE_NOOP("Keys", "Turn left"), ("Num+4",)),
    Command("view.turn_right", QT_TRANSLATE_NOOP("Keys", "Turn right"), ("Num+6",)),
    Command("view.turn_up", QT_TRANSLATE_NOOP("Keys", "Turn up"), ("Num+8",)),
    Command("view.turn_down", QT_TRANSLATE_NOOP("Keys", "Turn down"), ("Num+2",)),
    Command("view.front", QT_TRANSLATE_NOOP("Keys", "From the front"), ("Num+1",)),
    Command("view.back", QT_TRANSLATE_NOOP("Keys", "From behind"), ("Ctrl+Num+1",)),
    Command("view.right", QT_TRANSLATE_NOOP("Keys", "From the right"), ("Num+3",)),
    Command("view.left", QT_TRANSLATE_NOOP("Keys", "From the left"), ("Ctrl+Num+3",)),
    Command("view.top", QT_TRANSLATE_NOOP("Keys", "From above"), ("Num+7",)),
    Command("view.bottom", QT_TRANSLATE_NOOP("Keys", "From below"), ("Ctrl+Num+7",)),
    Command("view.turntable", QT_TRANSLATE_NOOP("Keys", "Turntable"), ("T",)),
    Command("view.panels", QT_TRANSLATE_NOOP("Keys", "Hide or show all panels"), ("Tab",), True),
    Command("view.full_screen", QT_TRANSLATE_NOOP("Keys", "Full screen"), ("F11",)),
    Command("help.tool", QT_TRANSLATE_NOOP("Keys", "Help for what is under the pointer"), ("F1",)),
    Command("help.tutorial", QT_TRANSLATE_NOOP("Keys", "Tutorial"), ("Shift+F1",)),
    Command("help.keys", QT_TRANSLATE_NOOP("Keys", "Sheet of all keys"), ("Ctrl+F1",)),
)
# fmt: on

# Where a preset differs from "patina".
DIFFERENCES: dict[str, dict[str, tuple[str, ...]]] = {
    "patina": {},
    "blender": {
        "brush.size": ("F",),
        "brush.hardness": ("Shift+F",),
        "edit.duplicate": ("Shift+D",),
        "view.frame_all": ("Home",),
        "view.frame_selected": ("Num+.",),
        "view.panels": ("N", "Tab"),
        "run.synthesize": ("F12", "Ctrl+R"),
    },
    "maya": {
        "brush.size": ("B",),
        "brush.hardness": ("N",),
        "edit.undo": ("Z", "Ctrl+Z"),
        "edit.redo": ("Ctrl+Y", "Ctrl+Shift+Z"),
        "tool.brush": ("Shift+B",),
        "view.frame_all": ("A", "Home"),
        "view.frame_selected": ("F", "Num+."),
        "view.pivot_stroke": ("D",),
    },
}

BY_ID = {each.id: each for each in COMMANDS}


def default_keys(preset: str, command: str) -> tuple[str, ...]:
    """Keys that a preset gives a command."""
    return DIFFERENCES[preset].get(command, BY_ID[command].keys)
