"""The reports of both diagnoses: one self-contained HTML file each."""
