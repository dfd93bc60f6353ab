"""Programs that measure: answers against other programs and an oracle, stability, and costs."""
