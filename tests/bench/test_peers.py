"""The peers' benchmark runs any program, names what it leaves out, and measures Patina."""

import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from app.benches import run_bench
from app.cli import app
from btfcore.errors import InvalidParameter
from tests.bench import peers, table
from tests.bench.test_planar import noise

TILE = """
import sys
import numpy as np
from PIL import Image
sample = np.asarray(Image.open(sys.argv[1]).convert("RGB"))
side = int(sys.argv[3])
times = -(-side // len(sample))
Image.fromarray(np.tile(sample, (times, times, 1))[:side, :side]).save(sys.argv[2])
"""


@pytest.fixture
def tiler(tmp_path):
    """A program that repeats its sample."""
    script = tmp_path / "tile.py"
    script.write_text(TILE, encoding="utf-8")
    return f"tiles={sys.executable} {script} {{in}} {{out}} {{size}}"


def cells(text, name):
    """Rows of a printed table whose first cell is `name`."""
    rows = [line.strip("| ").split("|") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows if row[0].strip() == name]


@pytest.mark.parametrize("text", ["no sign {in} {out}", "a=cmd {in}", "=cmd {in} {out}", "a="])
def test_a_malformed_peer_is_refused(text):
    with pytest.raises(InvalidParameter, match="is not of the form"):
        peers.Peer.of(text)


def test_a_peer_is_run_once_or_once_a_seed():
    assert peers.Peer.of("a b='c d' {in} {out}").command == ("c d", "{in}", "{out}")
    assert peers.Peer.of("a=c {in} {out}").seeds == (0,)
    assert peers.Peer.of("a=c -s{seed} {in} {out}").seeds == peers.SEEDS


def test_a_tiling_program_is_measured(tiler, tmp_path):
    (run,) = peers.run_peer(peers.Peer.of(tiler), noise(64), tmp_path, size=192)
    assert run.cpu_s > 0
    assert run.measures.self_repeat == 1 and run.measures.copied_side >= 48


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("raise SystemExit('out of luck')", "exit status 1, out of luck"),
        ("pass", "wrote no output"),
        ("import shutil, sys; shutil.copy(*sys.argv[1:3])", "64 x 64 pixels, not 192 x 192"),
    ],
)
def test_a_failing_program_is_named_with_the_reason(program, said, tmp_path):
    (tmp_path / "fails.py").write_text(program, encoding="utf-8")
    peer = peers.Peer.of(f"fails={sys.executable} {tmp_path / 'fails.py'} {{in}} {{out}}")
    with pytest.raises(InvalidParameter, match=said):
        peers.run_peer(peer, noise(64), tmp_path, size=192)
    missing = peers.Peer.of(f"gone={tmp_path / 'nowhere'} {{in}} {{out}}")
    with pytest.raises(InvalidParameter, match="nowhere"):
        peers.run_peer(missing, noise(64), tmp_path, size=192)


def test_patina_copies_from_the_sample_and_repeats_with_its_seed():
    sample = noise(64, 1)
    first, again, other = (
        peers.run_patina(sample, size=128, seeds=[seed])[0].measures for seed in (0, 0, 1)
    )
    assert first == again and first != other
    stranger = peers.measure_plane(sample, noise(128, 2))  # never saw the sample
    assert first.patch_nn < 0.75 * stranger.patch_nn
    assert first.copied_side > 2 * stranger.copied_side


def test_the_page_shows_every_measure_and_what_is_left_out(tiler, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(peers, "SIDE", 256)
    monkeypatch.setattr(table, "PAGE", tmp_path / "page.md")
    nothing = tmp_path / "no-python"
    run_bench("peers", write=False, quick=True, peers=[tiler], python=nothing)
    said = capsys.readouterr().out
    for name in ("Patina", "tiles"):
        rows = cells(said, name)
        assert [row[1] for row in rows] == ["brick", "gravel"]
        for row in rows:
            assert all(float(cell) >= 0 for cell in [row[3], *row[5:]])
    assert "left out: image quilting, OpenCV" in said and "no-python" in said
    assert not (tmp_path / "page.md").exists()


def test_the_command_line_hands_peers_over_and_refuses_them_elsewhere(monkeypatch):
    asked = {}
    monkeypatch.setattr(peers, "main", lambda **options: asked.update(options))
    given = ["bench", "peers", "--peer", "a=b {in} {out}", "--python", "py"]
    assert CliRunner().invoke(app, given).exit_code == 0
    assert asked["peers"] == ["a=b {in} {out}"] and str(asked["python"]) == "py"
    with pytest.raises(InvalidParameter, match="'dense' knows no option peers"):
        run_bench("dense", write=False, quick=True, peers=["a=b {in} {out}"])


def test_quoted_rows_are_marked():
    rows = peers.quoted()
    assert len(rows) == 8 and all("quoted, other machine" in str(row[0]) for row in rows)
    errors = {(row[0].split(" (")[0], row[1]): row[5] for row in rows}
    assert errors["graphcut in C++", "gravel"] == 0.125
    assert not np.isnan([float(row[9]) for row in rows]).any()
