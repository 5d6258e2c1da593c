"""Cars that no single-track model follows: days of logs from them, and how well the gap is diagnosed."""
