"""Growing and pruning a tree, node by node, depth first.

The functions of `nodes`, `cuts`, `nominal`, `growing`, `dealing`, `descent`, `pruning` and `reduced_error` are plain
Python: the interpreter runs them on lists, and `compiled` compiles them, with the rules of `criteria` and `estimates`,
for arrays. They make no array or list themselves.
"""
