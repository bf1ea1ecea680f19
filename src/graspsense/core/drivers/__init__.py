"""What the drivers of grippers share: polling, threads that read, emulated devices, clocks, and the finger linkage."""
