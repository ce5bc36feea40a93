"""Meshes: reading, repair, topology and distances."""
