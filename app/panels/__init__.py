"""Parts of the window that show the document and ask it to change."""
