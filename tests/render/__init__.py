"""Tests of colours and textures."""
