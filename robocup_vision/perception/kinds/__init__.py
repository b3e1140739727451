"""Classification of obstacles as robots or persons."""
