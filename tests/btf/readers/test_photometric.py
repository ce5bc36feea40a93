"""Real photographs under twelve lights, read through a light list as users have them."""

import numpy as np
import pytest

from btfcore.btf.readers.decode import decode_images
from btfcore.btf.readers.listing import pick_files
from btfcore.btf.readers.table import read_table

LIGHTS = 12


def images_of(folder, names):
    files = pick_files(folder, names)
    return [raw.values for raw in decode_images(files, files.entries)]


def lights_from_chrome(folder):
    """Directions (12, 3) towards the lights, from their reflections in a chrome ball."""
    names = [f"chrome.{number}.png" for number in range(LIGHTS)]
    *shots, mask = images_of(folder, [*names, "chrome.mask.png"])
    inside = mask.max(axis=2) > 128
    rows, columns = np.nonzero(inside)
    centre = np.array([columns.mean(), rows.mean()])
    radius = np.sqrt(inside.sum() / np.pi)
    out = []
    for shot in shots:
        grey = np.where(inside, shot.astype(float).mean(axis=2), 0)
        bright = np.nonzero(grey >= 0.9 * grey.max())
        x, down = (np.array([bright[1].mean(), bright[0].mean()]) - centre) / radius
        normal = np.array([x, -down, np.sqrt(max(0.0, 1 - x * x - down * down))])
        out.append(2 * normal[2] * normal - [0, 0, 1])  # mirrors the view, which is +z
    return np.array(out)


def test_a_rock_s_normals_follow_from_its_images(tmp_path, data, in_process):
    folder = data / "btf" / "photometric_stereo_rock"
    lights = lights_from_chrome(data / "btf" / "photometric_stereo_chrome")
    assert np.linalg.norm(lights, axis=1) == pytest.approx(1)
    rows = []
    for number, (x, y, z) in enumerate(lights.tolist()):
        name = f"rock.{number}.png"
        (tmp_path / name).write_bytes((folder / name).read_bytes())
        rows.append(f"{name} {x} {y} {z}")
    (tmp_path / "rock.lp").write_text(f"{LIGHTS}\n" + "\n".join(rows) + "\n")
    sample = read_table(tmp_path / "rock.lp", colour="linear")  # as these photographs are
    assert sample.stack.shape == (LIGHTS, 340, 512)
    (mask,) = images_of(folder, ["rock.mask.png"])
    inside = mask.max(axis=2) > 128
    values = sample.stack.read(range(LIGHTS))[:, inside].mean(axis=2).astype(np.float64)
    solved, *_ = np.linalg.lstsq(sample.lights, values, rcond=None)
    albedo = np.linalg.norm(solved, axis=0)
    normals = np.full((*inside.shape, 3), np.nan)
    normals[inside] = (solved / np.maximum(albedo, 1e-9)).T
    left = np.linalg.norm(sample.lights @ solved - values) / np.linalg.norm(values)
    assert left < 0.2  # Lambert and a few cast shadows
    assert (normals[inside][:, 2] > 0).mean() > 0.98
    assert 0.05 < np.median(albedo) < 1
    # the silhouette faces outwards
    place = np.argwhere(inside)
    for axis, component, sign in ((1, 0, 1), (0, 1, -1)):
        low, high = np.percentile(place[:, axis], [5, 95])
        first, last = place[place[:, axis] < low], place[place[:, axis] > high]
        assert sign * np.nanmean(normals[tuple(first.T)][:, component]) < -0.2
        assert sign * np.nanmean(normals[tuple(last.T)][:, component]) > 0.2
