"""Choice of a player's next plan: one module for each role or situation."""
