"""Painting imperfections: constrained graphcut, edits and their layers (Zhou §IV)."""
