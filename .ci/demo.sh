#!/usr/bin/env bash
# Opens the window with a demo; without a usable display decorates the same mesh headless.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

mesh=resources/meshes/spot.obj
sample=resources/textures/brick_red.png

can_open_a_window() {
    [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] || [ "$(uname -s)" != Linux ] || return 1
    .venv/bin/python -c 'from PyQt6.QtWidgets import QApplication; QApplication([])' 2>/dev/null
}

if can_open_a_window; then
    status=0
    .venv/bin/patina gui --script demo || status=$?
    [ "$status" = 2 ] || exit "$status" # 2: a named error, such as a display without OpenGL
fi
echo "patina: no window can be opened here, so the demo runs without one"
[ -n "$(find btfcore -name '*.nbi' -print -quit)" ] ||
    echo "patina: the first run compiles its kernels, which takes a minute or two"
mkdir -p out
.venv/bin/patina decorate "$mesh" "$sample" -o out/demo.glb --preview out/demo.png
echo "patina: picture $PWD/out/demo.png"
echo "patina: mesh    $PWD/out/demo.glb"
