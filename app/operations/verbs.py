"""All verbs of the window in one object."""

from __future__ import annotations

from app.operations.files import FileOperations


class Operations(FileOperations):
    """What menus, panels, drops and scripts call; `edits` has the verbs of painting."""
