"""Research beside the product, not in the package."""
