"""Graphcut quilting of a sample on a dense mesh (Zhou §III-B)."""
