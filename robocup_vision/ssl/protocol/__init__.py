"""How the league's messages are laid out, and how they become values and bytes."""
