"""The drive that tells best which of the hypotheses that an answer leaves is true."""
