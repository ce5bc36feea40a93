"""The same evaluation as GLSL text, and its values packed into textures."""
