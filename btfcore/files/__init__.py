"""What Patina writes to disk: decorated meshes, textures, quilting maps."""
