"""What a player knows of the ball: its own sightings, what hides it, and what team mates tell."""
