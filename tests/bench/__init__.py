"""Benchmarks of Patina's stages, printed as tables and kept in docs/benchmarks.md."""
