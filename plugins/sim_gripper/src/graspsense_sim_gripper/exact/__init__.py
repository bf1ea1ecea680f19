"""Exact discretisation of piecewise-linear scenes by the matrix exponential.

A scene with a straight drive, Coulomb friction and linear terms is linear between events: x' = A x + B u, with constant
matrices in each mode and u constant over a tick. Its solution after a duration h is exp(A h) x plus the integral of
exp(A s) B u over s from 0 to h. It has no discretisation error, whatever the stiffness. `discretise` decides whether
this applies to a scene, and computes the matrices once. `propagate` advances the plant with them and locates events.

Source: exponential integration of stiff contacts, B. Hammoud, L. Olivieri, L. Righetti, J. Carpentier and A. Del Prete,
"Exponential integration for efficient and accurate multibody simulation with stiff viscoelastic contacts", Multibody
System Dynamics 54, 2022.
"""
