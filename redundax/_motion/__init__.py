"""Motion: the index-1 equations integrated by diffrax, with stabilisation, stick and slip."""
