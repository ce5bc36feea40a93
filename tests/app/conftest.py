import pytest

from tests.app.fakes import torus
from tests.surfaces import blobs


@pytest.fixture(scope="session")
def ring():
    """(mesh, atlas, dense, field) of a torus by formula."""
    return torus()


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """A mesh file, an image file and a broken mesh file."""
    import numpy as np
    from PIL import Image

    folder = tmp_path_factory.mktemp("files")
    mesh, *_ = torus(coarse=16)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces]
    (folder / "ring.obj").write_text("\n".join(lines) + "\n")
    (folder / "broken.obj").write_text("v 1 2 nonsense\nf 1 2 3\n")
    image = (blobs(64, 64).colour * 255).astype(np.uint8)
    Image.fromarray(image).save(folder / "blobs.png")
    (folder / "noimage.png").write_text("this is no image")
    return folder


@pytest.fixture(scope="module")
def shared(qapp, tmp_path_factory):
    """A view with its tools, as far as the tests of a module have brought it."""
    from tests.app.studio import opened

    with opened(tmp_path_factory.mktemp("studio")) as studio:
        yield studio


@pytest.fixture
def studio(shared):
    """The same after a synthesis, without edits and with the options of a new user."""
    from tests.app.studio import cleared, painted

    return cleared(painted(shared))
