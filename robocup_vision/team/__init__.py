"""What robots of one team tell each other, and what each makes of it: messages, the ball as all know it, roles."""
