"""Campaigns: many drives of the real controller, drawn from what is not known of a machine."""
