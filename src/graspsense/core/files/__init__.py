"""Files and their texts, read within limits and written whole."""
