"""The emulated board as a device of the operating system, with real device nodes and the real kernel drivers."""
