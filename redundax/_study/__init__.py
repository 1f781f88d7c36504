"""Studies of many samples: in chunks, over devices, into files, with labels; tolerances of parts."""
