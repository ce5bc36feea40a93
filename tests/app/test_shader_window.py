"""The shader in a real window, whose OpenGL context goes and comes with its parent."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtWidgets import QApplication, QMainWindow  # noqa: E402
from pyvistaqt import QtInteractor  # noqa: E402

from btfcore.files.surface import export_input  # noqa: E402
from btfcore.render.gutter import gutter_source  # noqa: E402
from btfcore.render.lights import directional  # noqa: E402
from btfcore.render.surfels import placement, surfels  # noqa: E402
from tests.app.fragments import Stage, differences, patched  # noqa: E402
from tests.render.chance import factor_sample  # noqa: E402


def test_hiding_and_another_parent_show_the_same_picture(qtbot, ring):
    mesh, atlas, dense, field = ring
    first, second = QMainWindow(), QMainWindow()
    for window in (first, second):
        qtbot.addWidget(window)
        window.resize(200, 160)
    view = QtInteractor(first, auto_update=False, multi_samples=0, lighting="none", border=False)
    first.setCentralWidget(view)
    first.show()
    qtbot.waitExposed(first)
    elements = surfels(dense, field, patched(dense), placement(mesh.vertices))
    stage = Stage(
        export_input(mesh, atlas), elements, gutter_source(dense), size=(200, 160), plotter=view
    )
    lights = directional([0.5, 0.6, 1.0])
    apart, wanted = differences(stage, [factor_sample()], lights)
    assert len(apart) > 500 and wanted.std() > 20
    assert apart.mean() <= 1 and np.percentile(apart, 99.9) <= 4
    drawn = stage.draw()
    view.hide()
    QApplication.processEvents()
    view.show()
    assert np.array_equal(stage.draw(), drawn)
    second.setCentralWidget(view)
    second.show()
    first.hide()
    qtbot.waitExposed(second)
    assert np.array_equal(stage.draw(), drawn)
    view.close()
