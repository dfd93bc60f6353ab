"""What a scene will do, what it will cost and what may go wrong, said before it is solved.

This package assembles no stiffness and solves nothing.
"""
