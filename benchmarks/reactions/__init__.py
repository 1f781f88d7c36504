"""Who is right about the reactions of overconstrained mechanisms: exact truth beside what programs print."""
