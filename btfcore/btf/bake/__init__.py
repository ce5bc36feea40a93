"""Bakes PBR texture sets into BTF samples: relief, shadows, parallax and GGX."""
