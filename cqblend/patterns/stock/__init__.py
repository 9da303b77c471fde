"""Stock: pieces are split to fit sheets, get tabs and labels, are packed on sheets, and corrected for the kerf."""
