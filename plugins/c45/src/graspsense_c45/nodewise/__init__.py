"""The plain form of the builder: node by node, with numpy. It builds every tree."""
