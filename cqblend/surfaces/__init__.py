"""Primary surfaces of blends: points and derivatives in their own parameters, and exact splines of rails on them."""
