"""What a simulated drive meets beside the car: faults between its parts, and what screens them."""
