"""One module for each verb, found by its name: the function of the same name is the command."""
