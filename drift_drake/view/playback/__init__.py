"""Logs played back: a log's commands to cars in open loop, beside what the real car did."""
