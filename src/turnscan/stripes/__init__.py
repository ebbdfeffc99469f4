"""Frame → candidates per scan line → one sub-pixel Stripe with sigma and quality."""

from turnscan.stripes._stripe import Candidates, Orientation, Stripe, StripeFlag

__all__ = ["Candidates", "Orientation", "Stripe", "StripeFlag"]
