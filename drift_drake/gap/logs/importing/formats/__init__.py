"""Recorders' files of every format as topics: tables whose columns were read at the same ticks."""
