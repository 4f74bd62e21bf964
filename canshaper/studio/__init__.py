"""The live page: a crane under the stick, raw and shaped, in a browser (never in the daemon)."""
