"""Named errors: what is wrong, where, and the number that is wrong."""


class PatinaError(Exception):
    """Base of every error that Patina raises on purpose; its text is fit for a user."""


class InvalidMesh(PatinaError):
    """A mesh file or mesh arrays from which no surface can be made."""


class InvalidImage(PatinaError):
    """An image file or array that cannot serve as a sample."""


class InvalidBtf(PatinaError):
    """A BTF file, folder or array that cannot serve as a sample."""


class InvalidGuide(PatinaError):
    """A guide (user vectors for the orientation field) that cannot be used."""


class InvalidRegions(PatinaError):
    """Labels of regions, or samples for regions, that do not fit the mesh."""


class InvalidParameter(PatinaError):
    """A knob outside its range."""


class InvalidEdit(PatinaError):
    """An edit (stroke, area, stamp …) that makes no sense or does not fit the surface."""


class InvalidProject(PatinaError):
    """A project file that cannot be read, or contradicts itself."""


class InvalidQuilt(PatinaError):
    """A stored quilting map that cannot be read or contradicts itself."""


class AtlasFailed(PatinaError):
    """No atlas could be made, even by the fallbacks."""


class GuardedFailure(PatinaError):
    """A guarded child process crashed, hung or outgrew its limits."""


class OutputFailed(PatinaError):
    """A result could not be written; nothing was left under the final name."""


class ProjectChanged(OutputFailed):
    """The project on disk is not the one that was opened; it was not overwritten."""


class Cancelled(Exception):  # noqa: N818 - a request of the user, not an error
    """Raised by a progress callback to stop a stage; the stage leaves nothing half-done."""
