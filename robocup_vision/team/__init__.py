"""Cooperation of a team's robots: messages, the fused ball, and roles."""
