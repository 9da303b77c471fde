"""From what was picked to what is blended: edges between two faces, their spines, and what is around them."""
