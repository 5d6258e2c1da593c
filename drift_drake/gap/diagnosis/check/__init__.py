"""What logs are worth before anything is fitted to them."""
