"""The workbench: a folder's project in a browser, every step of it a command of the command line."""
