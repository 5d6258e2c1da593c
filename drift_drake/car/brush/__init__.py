"""A two-track car on brush tyres whose friction falls with sliding speed."""
