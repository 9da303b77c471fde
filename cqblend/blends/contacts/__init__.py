"""Contacts: for every station of an edge, the points of both surfaces at which a blend is to meet them."""
