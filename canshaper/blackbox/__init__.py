"""The black box: what the daemon received, did and sent in the last minute, exactly."""
