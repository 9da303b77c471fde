"""Is a finished solid sound, how smooth are its edges: measured by OCCT, told by the certificate."""
