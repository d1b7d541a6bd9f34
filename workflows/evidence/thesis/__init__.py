"""Studies: figures and statements of the thesis computed again, each beside the corrected method.

A module a study, with a function of its name; `workflows.evidence.catalogue` finds them.
"""
