"""A deployment file and its DBC files, checked and bound together."""
