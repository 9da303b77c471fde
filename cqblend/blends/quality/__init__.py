"""What is measured and proven of a finished blend: bounds of its errors, fairness, creases inside."""
