"""The steps of a day of commissioning, each with what it does and what it needs."""
