"""Rails: curves in the parameter planes of the two surfaces, and the ribbons of cross derivatives along them."""
