"""From pieces to flat stock: split, tabs, flaps, labels, kerf, nesting on sheets."""
