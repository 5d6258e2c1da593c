"""Cases of cars that their simulators lack something of: made, diagnosed and scored."""
