"""From a quilting map to colours: per vertex, and as a texture of the atlas."""
