"""What both diagnoses share: the posterior, ranges of magnitudes, where a gap is, what shows an effect."""
