"""Content of the league's messages, as frozen values in metres, radians and seconds."""
