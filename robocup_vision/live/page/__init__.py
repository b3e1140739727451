"""The process that serves the page: keeps moments, makes pictures of them, and handles the pages' requests."""
