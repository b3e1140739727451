"""What the league's messages say, as frozen values in metres, radians and seconds."""
