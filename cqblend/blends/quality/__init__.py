"""What is known of a finished blend: proven bounds, fairness, creases inside."""
