"""What tools show of a network."""
