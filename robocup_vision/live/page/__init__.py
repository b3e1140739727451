"""The process that serves the page: keeps what was seen, makes pictures of it, and answers what pages ask for."""
