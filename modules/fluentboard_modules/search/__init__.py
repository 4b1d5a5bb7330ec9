"""Active search (thesis, chapter 5): look where it pays until the object is found."""
