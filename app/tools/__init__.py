"""What the pointer does to the surface: tools, what they draw, and how events reach them."""
