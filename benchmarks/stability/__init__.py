"""Programs that search for failures: random scenes under independent checks, spoilt input, drawn
mistakes.
"""
