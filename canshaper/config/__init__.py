"""The deployment file: its schema, its loading, its errors with file and line."""
