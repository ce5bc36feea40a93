"""Patina's core: meshes, samples, quilting and files, free of any window or view."""

__version__ = "0.1.0"
