"""What becomes of loops with faults in them, and of work that is interrupted."""
