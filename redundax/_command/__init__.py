"""The command line: its arguments, what it computes and shows, and the programs that it keeps."""
