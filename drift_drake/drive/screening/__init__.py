"""What the car's sensors say, late and noisy, and which readings are believed."""
