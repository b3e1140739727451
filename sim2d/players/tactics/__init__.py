"""What a player does next: one module a role or situation."""
