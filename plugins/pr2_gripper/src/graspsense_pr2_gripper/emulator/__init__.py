"""The software board as a device of the operating system: real nodes, real kernel, no hardware."""
