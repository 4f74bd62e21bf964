"""The questions of ``canshaper init``: answers, a checked machine, the text of its file."""
