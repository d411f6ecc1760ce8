"""The page of a run, and the pages and figures that are made from published runs."""
