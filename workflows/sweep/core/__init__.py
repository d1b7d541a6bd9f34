"""Many cases of a chain: which, what each leaves behind, what the numbers that vary do."""
