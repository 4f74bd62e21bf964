"""One module for each verb; its function of the same name is the command."""
