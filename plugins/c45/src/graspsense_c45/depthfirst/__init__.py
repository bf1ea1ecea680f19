"""The compiled engine: a tree is grown and pruned node by node, depth first.

It builds trees of numeric attributes without missing values. `nodes`, `scanning`, `growing`, `pruning` and `routing`
hold plain functions that `compiled` compiles together with the rules of `criteria` and `estimates`; the interpreter
runs them too, slowly.
"""
