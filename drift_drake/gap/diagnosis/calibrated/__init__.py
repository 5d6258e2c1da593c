"""The diagnosis of a car that was calibrated by prediction: what has changed since that day."""
