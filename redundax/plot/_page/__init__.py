"""A report of a mechanism as a page: HTML or Markdown."""
