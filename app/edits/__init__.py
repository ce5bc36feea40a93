"""The edits of the window: verbs that return at once, and the one worker that paints."""

from app.edits.verbs import Edits as Edits
