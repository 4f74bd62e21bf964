"""The controller of one machine in C99, for machines without a PC: export, tables, library."""
