"""A deployment file is changed: single values, every other byte as it is."""
