"""Logs played back: a log's commands to cars in open loop, compared with the real car."""
