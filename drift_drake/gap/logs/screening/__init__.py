"""Logs looked at before any estimate: bad samples left out, units, signs and clocks doubted before physics is."""
