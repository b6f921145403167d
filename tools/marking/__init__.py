"""How many clicks a mask takes: a simulated user marks photos whose masks are known."""
