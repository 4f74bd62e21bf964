"""J1939 and ISO 11783: address claim, groups, DM1."""
