"""The scenes and robots that the programs simulate."""
