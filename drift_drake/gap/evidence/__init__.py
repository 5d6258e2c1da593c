"""What both diagnoses share: the posterior, where a gap is, what shows an effect."""
