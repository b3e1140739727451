"""Small linear algebra shared by kernels."""
