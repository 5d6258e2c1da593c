"""The learnt model's data and how well it predicts."""
