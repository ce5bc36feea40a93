"""The verbs of the window: values in, a background job, and its result into the document."""

from app.operations.samples import MOST_SAMPLES as MOST_SAMPLES
from app.operations.samples import SAMPLE_SUFFIXES as SAMPLE_SUFFIXES
from app.operations.samples import is_sample as is_sample
from app.operations.surface import is_mesh as is_mesh
from app.operations.surface import prepare as prepare
from app.operations.verbs import Operations as Operations
