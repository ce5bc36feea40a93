"""Our own sample package (.btfz): a zip of stored members that can be mapped into memory."""
