"""Scenes, commands, run folders and pictures: what turns the rooms below into a program."""
