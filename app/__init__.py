"""The workbench: segmap in the browser and on the command line."""
