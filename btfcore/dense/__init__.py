"""From a mesh to the dense mesh: one vertex per texel of a packed atlas."""
