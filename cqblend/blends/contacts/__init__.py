"""Contacts: from stations along an edge to the points where a rolling ball, or a set-back, touches the two faces."""
