"""`patina sample …` from one end to the other, on samples made here."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from app.cli import app
from btfcore.errors import PatinaError
from btfcore.files.package.read import read_package, read_preview
from btfcore.files.package.write import write_package
from btfcore.files.samples import open_sample
from tests.btf.bricks import sample


def patina(*words):
    """Run a command; returns what it printed, and raises what it raised."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A PBR set of 24 x 24 texels: bumps on a grid, half of them red."""
    folder = tmp_path_factory.mktemp("bumps")
    y, x = np.mgrid[:24, :24] / 24
    height = 0.5 + 0.25 * (np.sin(4 * np.pi * x) + np.sin(4 * np.pi * y))
    albedo = np.zeros((24, 24, 3), np.uint8) + 120
    albedo[height > 0.5] = (180, 60, 40)
    Image.fromarray(albedo).save(folder / "bumps_Color.png")
    Image.fromarray(np.round(height * 255).astype(np.uint8)).save(folder / "bumps_Displacement.png")
    rough = np.full((24, 24), 140, np.uint8)
    Image.fromarray(rough).save(folder / "bumps_Roughness.png")
    return folder


@pytest.fixture(scope="module")
def package(maps, tmp_path_factory):
    """The set baked at 12 x 3 x 12 x 3 directions and factorised."""
    path = tmp_path_factory.mktemp("baked") / "bumps.btfz"
    text = patina("sample", "bake", maps, "-o", path, "--layout", "12x3x12x3", "--rank", "12")
    assert "36 views x 36 lights, 12 factors" in text
    return path


def test_a_baked_set_can_be_described(package):
    figures = json.loads(patina("sample", "info", package, "--json"))
    assert figures["kind"] == "package"
    assert (figures["width"], figures["height"], figures["images"]) == (24, 24, 1296)
    assert (figures["factors"], figures["missing"], figures["tiles"]) == (12, 0, True)
    text = patina("sample", "info", package)
    assert "views" in text and "36" in text


def test_a_package_carries_its_own_preview(package):
    picture = read_preview(package)
    assert picture.startswith(b"\x89PNG")


def test_a_preview_is_a_picture(package, tmp_path):
    out = tmp_path / "sheet.png"
    patina("sample", "preview", package, package, "-o", out, "--cell", "48", "--views", "0,0 60,90")
    page = np.asarray(Image.open(out))
    assert page.shape == (4 + 4 * (48 + 20), 4 + 5 * 52, 3)
    assert np.array_equal(page[4:136], page[140:272]), "the same sample twice looks the same"
    assert page.std() > 10


def test_a_raw_package_factorises_to_what_was_baked_at_once(maps, package, tmp_path):
    raw, small = tmp_path / "raw.btfz", tmp_path / "small.btfz"
    patina("sample", "bake", maps, "-o", raw, "--layout", "12x3x12x3", "--rank", "none")
    assert read_package(raw).factors is None
    patina("sample", "factorize", raw, "-o", small, "--rank", "12")
    at_once, later = read_package(package), read_package(small)
    numbers = np.arange(0, 1296, 53)
    apart = at_once.stack.read(numbers) - later.stack.read(numbers)
    assert np.sqrt((apart.astype(np.float64) ** 2).mean()) < 2e-3
    figures = json.loads(patina("sample", "errors", small, "--against", raw, "--json"))
    assert 0 < figures["srgb_rmse"] < 0.05 and figures["rank"] == 12


def test_a_package_says_itself_how_it_is_decoded(maps, tmp_path):
    """Only what the manifest's text says is used here, none of our own readers."""
    from zipfile import ZipFile

    from safetensors.numpy import load

    for name in ("linear", "sqrt", "log", "logluma"):
        path = tmp_path / f"{name}.btfz"
        patina(
            "sample", "factorize", maps, "-o", path, "--layout", "4x2x4x2", "--size", "12",
            "--rank", "9", "--encoding", name, "--knee", "0.2",
        )  # fmt: skip
        with ZipFile(path) as archive:
            tensors = load(archive.read("factors.safetensors"))
            manifest = json.loads(archive.read("manifest.json"))
        assert "decode undoes the encoding" in manifest["conventions"]
        weights, basis = (tensors[key].astype(np.float64) for key in ("weights", "basis"))
        code, number = manifest["encoding"], 37
        c = np.einsum("hwk,ck->hwc", weights, basis[number]) + tensors["mean"][number]
        if name == "linear":
            x = np.maximum(c, 0)
        elif name == "sqrt":
            x = np.maximum(c, 0) ** 2
        elif name == "log":
            x = np.maximum(np.exp(c) - code["epsilon"], 0)
        else:
            y = np.exp(c[..., 0])
            red, blue = c[..., 1] * y, c[..., 2] * y
            green = (y - 0.2126 * red - 0.0722 * blue) / 0.7152
            x = np.maximum(np.stack([red, green, blue], axis=-1) - code["epsilon"], 0)
        knee = code["knee"]
        x = np.where(x > knee, knee * np.exp(x / knee - 1), x)
        ours = open_sample(path).image(*divmod(number, len(manifest["lights"])))
        assert np.abs(x - ours).max() < 1e-5


def test_errors_fall_with_the_rank(maps):
    found = [
        json.loads(
            patina(
                "sample",
                "errors",
                maps,
                "--layout",
                "6x2x6x2",
                "--rank",
                rank,
                "--held-out",
                "--json",
            )
        )  # fmt: skip
        for rank in (2, 8)
    ]
    assert found[1]["srgb_rmse"] < found[0]["srgb_rmse"]
    assert found[0]["held_out_srgb_rmse"] >= found[0]["srgb_rmse"] * 0.9


def test_auto_rank_meets_the_wanted_error(maps, tmp_path):
    out = tmp_path / "auto.btfz"
    patina(
        "sample",
        "bake",
        maps,
        "-o",
        out,
        "--layout",
        "6x2x6x2",
        "--rank",
        "auto",
        "--rmse",
        "0.006",
    )
    raw = tmp_path / "raw.btfz"
    patina("sample", "bake", maps, "-o", raw, "--layout", "6x2x6x2", "--rank", "none")
    figures = json.loads(patina("sample", "errors", out, "--against", raw, "--json"))
    assert figures["srgb_rmse"] <= 0.006 and 1 < figures["rank"] < 40


@pytest.mark.parametrize("name", ["back.zip", "back.btf", "back.btfz"])
def test_converted_samples_open_again(package, tmp_path, name):
    out = tmp_path / name
    patina("sample", "convert", package, "-o", out, "--components", "40", "--raw")
    one, two = read_package(package), open_sample(out)
    assert (one.images, one.shape) == (two.images, two.shape)
    numbers = [0, 400, 1290]
    for number in numbers:
        view, light = one.pairs()[number]
        near = np.argmin(np.linalg.norm(two.views - one.views[view], axis=1))
        lit = np.argmin(np.linalg.norm(two.lights - one.lights[light], axis=1))
        apart = one.image(view, light) - two.image(near, lit)
        assert np.sqrt((apart.astype(np.float64) ** 2).mean()) < 0.02


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("info", "nowhere.btfz"), "there is no such file"),
        (("bake", "nowhere", "-o", "out.png"), "out.png"),
        (("factorize", "{package}", "-o", "{out}.btfz", "--rank", "many"), "'many'"),
        (("factorize", "{package}", "-o", "{out}.btfz", "--rank", "0"), "rank 0"),
        (("factorize", "{package}", "-o", "{out}.btfz", "--encoding", "zip"), "zip"),
        (("errors", "{package}"), "--against"),
        (("convert", "{package}", "-o", "{out}.exr"), "is written as"),
        (("preview", "{package}", "-o", "{out}.png", "--views", "95,0"), "95,0"),
        (("preview", "{package}", "-o", "{out}.png", "--exposure", "nan"), "exposure of nan"),
        (("info", "{maps}", "--layout", "spiral"), "spiral"),
        (("bake", "{maps}", "-o", "{out}.btfz", "--memory", "-5"), "memory of -5"),
        (("bake", "{maps}", "-o", "{out}.btfz", "--rank", "1000000000"), "1000000000"),
        (("bake", "{maps}", "-o", "{out}.btfz", "--rmse", "0"), "RMSE of 0"),
        (("bake", "{maps}", "-o", "{out}.btfz", "--encoding", "zip"), "zip"),
        (("convert", "{package}", "-o", "{package}"), "the same file"),
    ],
)
def test_wrong_requests_end_in_one_line(package, maps, tmp_path, words, message):
    places = {"package": package, "maps": maps, "out": tmp_path / "out"}
    with pytest.raises(PatinaError, match=message):
        patina("sample", *(word.format(**places) for word in words))
    assert list(tmp_path.iterdir()) == []


def test_a_wanted_error_that_is_not_reached_is_told(maps, tmp_path, monkeypatch):
    monkeypatch.setattr("btfcore.btf.factor.svd.CAP", 2)
    out = tmp_path / "a.btfz"
    words = ("--layout", "4x2x4x2", "--rank", "auto", "--rmse", "0.00001")
    assert "not the 1e-05" in patina("sample", "bake", maps, "-o", out, *words)
    assert any("not the 1e-05" in note for note in read_package(out).notes)


def test_a_sphere_is_decorated_with_a_package(package, tmp_path):
    from btfcore.library import resource_folder

    out = tmp_path / "ball.glb"
    mesh = resource_folder() / "meshes" / "sphere.obj"
    patina("decorate", mesh, package, "-o", out, "--rate", "64")
    assert out.read_bytes()[:4] == b"glTF"


def test_a_picture_as_a_sample_costs_no_factorisation(tmp_path):
    path = tmp_path / "picture.png"
    Image.fromarray(np.full((8, 9, 3), 90, np.uint8)).save(path)
    figures = json.loads(patina("sample", "info", path, "--json"))
    assert (figures["kind"], figures["images"], figures["width"]) == ("image", 1, 9)
    with pytest.raises(PatinaError, match="nothing to factorise"):
        patina("sample", "factorize", path, "-o", tmp_path / "a.btfz")


def test_missing_images_survive_the_package(tmp_path):
    whole = sample()
    path = write_package(tmp_path / "a.btfz", whole)
    figures = json.loads(patina("sample", "info", path, "--json"))
    assert figures["view_rings"] == "0x1 40x4" and figures["light_rings"] == "0x1 30x5 65x6"
