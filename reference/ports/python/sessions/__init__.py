"""Ends of links: pure machines on a virtual clock. Every time is in whole nanoseconds, counted from any instant."""
