"""The axis in C99 for machines without a PC: tables from a deployment, and what runs them here."""
