"""Scenes, commands, run folders and pictures: what turns the rooms below into a program."""

from workflows import aliases

aliases.install()
