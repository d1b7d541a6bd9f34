"""The numbers of the thesis, read from `thesis.toml`."""

import tomllib
from importlib.resources import files

THESIS = tomllib.loads((files("beadwave.workflows") / "thesis.toml").read_text(encoding="utf-8"))
HAMMER_TEST = THESIS["hammer_test"]
HAMMER_TEST_HZ = tuple(HAMMER_TEST["hz"])
