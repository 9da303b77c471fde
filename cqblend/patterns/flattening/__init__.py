"""Development: ruled strips laid flat, rulings straight and lengths kept."""
