"""The commissioning of a machine as steps: what each needs, shows, finds, and would write."""
