"""Add-ons, which nothing else imports: they prove, differentiate, draw and report what has been
solved, or read decks.

``extensions.add_on`` finds them by their entry points.  They must not use private names of the
rest, or of each other.
"""
