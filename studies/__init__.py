"""Research next to the product, not in the package."""
