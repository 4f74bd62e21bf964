"""The paper's simulations once more: drives, curves and numbers of its section 4."""
