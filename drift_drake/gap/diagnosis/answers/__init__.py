"""What a diagnosis says, as a file: written, read, applied to the vehicle file, and tied to what it was found from."""
