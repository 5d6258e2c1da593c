"""The workbench's pages, one a step."""
