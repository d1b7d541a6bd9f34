"""Recorded signals: what the files of lasers, gauges and oscilloscopes hold."""
