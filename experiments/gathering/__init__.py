"""Information gathered along a lane, round after round."""
