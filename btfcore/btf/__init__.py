"""Texture samples: readers now; measured materials (BTFs) later."""
