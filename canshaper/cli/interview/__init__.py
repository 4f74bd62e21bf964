"""Questions of ``canshaper init``, their answers, and the text of the first deployment file."""
